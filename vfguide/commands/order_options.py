"""The options of `vfguide order`."""

from typing import Annotated

import typer

from vfguide.commands.shared_options import (
    Insecure,
    KeyFile,
    LinkUrls,
    MissionFile,
    RosterFile,
)
from vfguide.mission import read_mission


def order(
    mission: MissionFile,
    what: Annotated[
        list[str],
        typer.Argument(
            metavar="WHAT",
            help="A shape (vee, echelon-left, echelon-right, line-abreast, trail, diamond, finger-four);"
            " spacing; swap A B; slot NAME=FORWARD,RIGHT; leave NAME; join NAME; path NAME;"
            " lead NAME; hold; resume; abort.",
        ),
    ],
    *,
    link: LinkUrls,
    spacing: Annotated[
        float | None,
        typer.Option(metavar="M", min=1.0, max=1000.0, help="Between neighbours, metres."),
    ] = None,
    dry_run: Annotated[
        bool,
        typer.Option("--dry-run", help="Rehearse it from the present state, and order nothing."),
    ] = False,
    key: KeyFile = None,
    roster: RosterFile = None,
    insecure: Insecure = False,
) -> None:
    """Order a formation that flies to change: rehearsed first, then agreed on by all vehicles.

    Exit status: 0 flown by all (or rehearsed), 1 not flown, 2 the input is wrong or the order cannot be
    carried out, 3 no link, or the formation is not heard.
    """
    from vfguide.commands.credentials import KeyFiles
    from vfguide.commands.order import give, order_of

    wanted = order_of(what, spacing)
    loaded = read_mission(mission)
    keys = KeyFiles(mission=mission, key=key, roster=roster, insecure=insecure)
    raise typer.Exit(give(loaded.mission, wanted, links=link, keys=keys, dry_run=dry_run))
