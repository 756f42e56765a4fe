"""A formation's members on the command line: their keys, who flies in the mission, and who watches it."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from vfguide.errors import InputError
from vfguide.link.carrier import LinkAddress, parse_links
from vfguide.link.keys import OPERATOR, Roster, key_places, read_private_key, read_roster
from vfguide.link.opening import WatchedFormation
from vfguide.mission import Mission

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

REMEDY = "make keys with `vfguide keys make MISSION`"


@dataclass(frozen=True, slots=True, kw_only=True)
class Credentials:
    """What a member signs with, and whom it believes."""

    roster: Roster | None
    """Everybody's public keys; None to believe anybody."""
    key: "Ed25519PrivateKey | None"
    """The own private key; None to sign nothing."""


ANYBODY = Credentials(roster=None, key=None)


@dataclass(frozen=True, slots=True, kw_only=True)
class KeyFiles:
    """What the command line says about keys."""

    mission: Path
    """The mission's file, beside which keys are looked for."""
    key: Path | None = None
    """The private key, if an option names it."""
    roster: Path | None = None
    """The roster, if an option names it."""
    insecure: bool | None = None
    """Whether nothing is to be signed; None where no option asks."""

    def of_vehicle(self, name: str) -> Credentials:
        """What a vehicle signs with, and whom it believes.

        Raises:
            InputError: a file is missing or cannot be used.
        """
        if self._believes_anybody():
            return ANYBODY
        path = self.key or key_places(self.mission).private(name)
        if not path.exists():
            raise InputError(f"{path}: there is no private key of {name!r}; {self._remedy()}")
        return Credentials(roster=self._read_roster(), key=read_private_key(path))

    def of_operator(self) -> Credentials:
        """Keys of an operator. Without a private key nothing shows that what it hears is new.

        Raises:
            InputError: a file is missing or cannot be used.
        """
        if self._believes_anybody():
            return ANYBODY
        path = self.key or key_places(self.mission).private(OPERATOR)
        has_key = self.key is not None or path.exists()
        return Credentials(
            roster=self._read_roster(), key=read_private_key(path) if has_key else None
        )

    def _read_roster(self) -> Roster:
        path = self.roster or key_places(self.mission).roster
        if not path.exists():
            raise InputError(f"{path}: there is no roster; {self._remedy()}")
        return read_roster(path)

    def _remedy(self) -> str:
        unsigned = "" if self.insecure is None else ", or type --insecure to believe anybody"
        return REMEDY + unsigned

    def _believes_anybody(self) -> bool:
        if self.insecure and (self.key or self.roster):
            raise InputError("--insecure: nothing is signed; leave it out, or --key and --roster")
        return bool(self.insecure)


def flying(mission: Mission) -> list[str]:
    """Vehicles that fly in a mission, leader first."""
    return [mission.leader.vehicle, *mission.followers_by_name]


def check_flies(mission: Mission, vehicle: str) -> None:
    """See that a vehicle flies in the mission.

    Raises:
        InputError: it does not.
    """
    if vehicle not in flying(mission):
        raise InputError(
            f"{vehicle!r} does not fly in {mission.name}; one of {', '.join(flying(mission))} does"
        )


def check_deputies(mission: Mission, links: Sequence[LinkAddress]) -> None:
    """See that the links carry what deputies say: a slow radio has no room for it.

    Raises:
        InputError: there are deputies, and a radio.
    """
    if mission.deputies and any(one.scheme == "serial" for one in links):
        raise InputError(
            f"{mission.name}: deputies cannot lead over serial://; use another link, or remove `deputies`"
        )


def watched_formation(
    mission: Mission, links: Sequence[str], credentials: Credentials
) -> WatchedFormation:
    """The formation of a mission, for an operator who watches it over some links.

    Raises:
        InputError: an address is wrong.
    """
    return WatchedFormation(
        addresses=parse_links(links),
        formation=mission.name,
        leader=mission.timekeeper,
        deputies=mission.deputies,
        roster=credentials.roster,
        key=credentials.key,
    )
