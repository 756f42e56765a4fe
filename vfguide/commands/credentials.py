"""Keys and membership of a formation's vehicles and operators, from the command line."""

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
    """Keys of a member."""

    roster: Roster | None
    """Public keys of all members; None accepts messages of anybody."""
    key: "Ed25519PrivateKey | None"
    """Private key of the member; None leaves messages unsigned."""


ANYBODY = Credentials(roster=None, key=None)


@dataclass(frozen=True, slots=True, kw_only=True)
class KeyFiles:
    """Key options of the command line; None where an option is absent."""

    mission: Path
    """Mission file, beside which keys are looked for."""
    key: Path | None = None
    roster: Path | None = None
    insecure: bool | None = None
    """Whether messages are unsigned; None where the command has no such option."""

    def of_vehicle(self, name: str) -> Credentials:
        """Return the keys of a vehicle.

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
        """Return the keys of an operator; without a private key, replayed messages go undetected.

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
    """Return the vehicles that fly in a mission, leader first."""
    return [mission.leader.vehicle, *mission.followers_by_name]


def check_flies(mission: Mission, vehicle: str) -> None:
    """Check that a vehicle flies in the mission.

    Raises:
        InputError: it does not.
    """
    if vehicle not in flying(mission):
        raise InputError(
            f"{vehicle!r} does not fly in {mission.name}; one of {', '.join(flying(mission))} does"
        )


def check_by_mavsdk(mission: Mission, vehicle: str, **options: object) -> None:
    """Check that no option needs what MAVSDK does not hand on: signatures, and others' commands.

    Raises:
        InputError: one does.
    """
    needing = [name.replace("_", "-") for name, value in options.items() if value]
    if needing and mission.vehicles[vehicle].by_mavsdk:
        raise InputError(f"--{needing[0]}: MAVSDK does not hand that on; write `autopilot: px4`")


def check_deputies(mission: Mission, links: Sequence[LinkAddress]) -> None:
    """Check that the links have room for the messages of deputies, as a slow radio has not.

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
    """Return the formation of a mission for an operator who watches it over some links.

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
