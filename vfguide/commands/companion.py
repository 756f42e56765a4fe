"""`vfguide companion`: the daemon for one real vehicle."""

import asyncio
import gc
import json
import logging
import sys
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from vfguide.commands.credentials import (
    Credentials,
    KeyFiles,
    check_by_mavsdk,
    check_deputies,
    check_flies,
)
from vfguide.commands.options import (
    AutopilotUrl,
    Insecure,
    KeyFile,
    LinkUrls,
    MissionOption,
    RosterFile,
    SigningKeyFile,
    StateDirectory,
    VehicleName,
    in_directory,
)
from vfguide.commands.terminal import stop_event
from vfguide.companion.clock import Clock
from vfguide.companion.consent import FileStore, default_directory
from vfguide.companion.daemon import Daemon, Surroundings
from vfguide.companion.ground_orders import OrderGiver, ground_orders_of
from vfguide.companion.mission_plan import adapter_of, flight_plan
from vfguide.errors import InputError
from vfguide.link.carrier import parse_links
from vfguide.link.keys import OPERATOR, key_places, read_revocations
from vfguide.link.opening import operator_of
from vfguide.link.trust import Trust, new_session
from vfguide.mavlink.address import Address, parse_address
from vfguide.mavlink.framing import signing_key
from vfguide.mission import Mission, read_mission
from vfguide.record.recording import begin_recording

STANDARD = frozenset(vars(logging.makeLogRecord({}))) | {"message", "asctime", "taskName"}
"""Standard attributes of log records; all others came with `extra`."""


class LogFormat(StrEnum):
    """Format of the log."""

    AUTO = "auto"
    """Text where standard error is a terminal, else JSON."""
    JSON = "json"
    """One JSON object per line."""
    TEXT = "text"
    """One short line per entry: time of day, vehicle, level, message."""


class JsonFormatter(logging.Formatter):
    """Formats time, level, logger, message and all extra attributes as JSON."""

    def format(self, record: logging.LogRecord) -> str:
        """Format a record as one line."""
        content: dict[str, object] = {
            "time": datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds"),
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": record.getMessage(),
        }
        content |= {key: value for key, value in vars(record).items() if key not in STANDARD}
        if record.exc_info:
            content["exception"] = self.formatException(record.exc_info)
        return json.dumps(content, default=str)


class TextFormatter(logging.Formatter):
    """Formats local time of day, vehicle, level and message."""

    def __init__(self, vehicle: str) -> None:
        """Take the name of the vehicle, which most records lack."""
        super().__init__()
        self._vehicle = vehicle

    def format(self, record: logging.LogRecord) -> str:
        """Format a record as one line, followed by its traceback, if any."""
        when = datetime.fromtimestamp(record.created, UTC).astimezone()
        clock = when.isoformat(timespec="milliseconds")[11:23]
        # A message may contain text from the link: nothing that moves a cursor goes to a terminal.
        message = "".join(one if one.isprintable() else " " for one in record.getMessage())
        line = f"{clock}  {self._vehicle}  {record.levelname.lower():7}  {message}"
        return f"{line}\n{self.formatException(record.exc_info)}" if record.exc_info else line


def log_to_standard_error(log_format: LogFormat, vehicle: str) -> None:
    """Send all log records of this process to standard error, for one vehicle."""
    readable = log_format is LogFormat.TEXT or (
        log_format is LogFormat.AUTO and sys.stderr.isatty()
    )
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(TextFormatter(vehicle) if readable else JsonFormatter())
    logging.basicConfig(level=logging.INFO, handlers=[handler], force=True)


logger = logging.getLogger(__name__)


def companion(
    vehicle: VehicleName,
    *,
    mission: MissionOption,
    mavlink: AutopilotUrl,
    link: LinkUrls,
    key: KeyFile = None,
    roster: RosterFile = None,
    insecure: Insecure = False,
    engage: Annotated[
        bool,
        typer.Option(
            "--engage",
            help="Put the autopilot into its guided mode without the pilot, once in a flight.",
        ),
    ] = False,
    record: Annotated[Path | None, in_directory("Record every start in a directory below.")] = None,
    state: StateDirectory = None,
    signing_key_file: SigningKeyFile = None,
    leader: Annotated[
        str | None,
        typer.Option(
            metavar="URL",
            help="Address at which a leader without a companion is heard; default: the"
            " mission's leader.connection.",
        ),
    ] = None,
    follow_target: Annotated[
        str | None,
        typer.Option(
            metavar="URL",
            help="Send a leader's FOLLOW_TARGET there, 10 Hz, for followers without a companion.",
        ),
    ] = None,
    ground_station_orders: Annotated[
        bool,
        typer.Option(
            "--ground-station-orders",
            help="Give orders that a ground station requests by MAV_CMD_USER_1; needs an operator's key.",
        ),
    ] = False,
    operator_key: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Private key that signs those orders; default: the key of `operator` beside the mission.",
        ),
    ] = None,
    log_format: Annotated[
        LogFormat,
        typer.Option(
            help="How the log is written to standard error; auto: text on a terminal, else JSON lines."
        ),
    ] = LogFormat.AUTO,
    clock: Annotated[str | None, typer.Option(hidden=True)] = None,
) -> None:
    """Run the companion of one vehicle, until SIGTERM.

    It never arms, and unless --engage says so it never changes the autopilot's mode: it steers while
    the pilot has selected the guided mode. Exit status: 0 stopped cleanly, 2 the input is wrong, 3 broken.
    """
    flown = read_mission(mission).mission
    keys = KeyFiles(mission=mission, key=key, roster=roster, insecure=insecure)
    check_flies(flown, vehicle)
    check_by_mavsdk(
        flown,
        vehicle,
        signing_key_file=signing_key_file,
        ground_station_orders=ground_station_orders,
    )
    heard_at = leader_address(flown, vehicle, leader)
    sends_to = None if follow_target is None else parse_address(follow_target)
    if sends_to is not None and vehicle != flown.leader.vehicle:
        raise InputError(f"--follow-target: {vehicle!r} does not lead {flown.name}; leave it out")
    giver = None
    if ground_station_orders:
        giver = order_giver(flown, keys, operator_key)
    elif operator_key is not None:
        raise InputError("--operator-key: goes with --ground-station-orders; leave it out")
    autopilot, own_clock = parse_address(mavlink), parse_clock(clock)
    addresses = parse_links(link)
    check_deputies(flown, addresses)
    trust = trust_in(flown, vehicle, keys.of_vehicle(vehicle))
    kept = state or default_directory()
    revocations = kept / f"{vehicle}.revoked"
    refused = trust.recall(read_revocations(revocations))
    signing = None if signing_key_file is None else read_key(signing_key_file)
    log_to_standard_error(log_format, vehicle)
    if refused:
        logger.warning(
            "%s: %d of its lines revoke no key in use, or are damaged: where a key is out,"
            " `vfguide keys revoke` it again",
            revocations,
            refused,
        )
    if not trust.signs:
        logger.warning(
            "--insecure: messages are not signed, and anybody on the link can lead this vehicle"
        )
    recording = None
    if record is not None:
        recording = begin_recording(record, flown, vehicle, clock_s=own_clock.now())
    surroundings = Surroundings(
        mavlink=autopilot,
        links=addresses,
        formation=flown.name,
        trust=trust,
        clock=own_clock,
        engage=engage,
        record=recording,
        signing_key=signing,
        consent=FileStore(kept, vehicle),
        revocations=revocations,
        by_mavsdk=flown.vehicles[vehicle].by_mavsdk,
        leader=heard_at,
        followers=sends_to,
        order_giver=giver,
        ground_orders=None if giver is None else ground_orders_of(flown),
    )
    plan = flight_plan(flown, vehicle)
    asyncio.run(run_until_stopped(Daemon(plan, adapter_of(flown.vehicles[vehicle]), surroundings)))


async def run_until_stopped(daemon: Daemon) -> None:
    """Run a companion until SIGTERM or SIGINT.

    Raises:
        InputError: an address cannot be used.
    """
    stop = stop_event()
    # The program's own objects stay: searching them for garbage takes 10 to 20 ms each time.
    gc.collect()
    gc.freeze()
    await daemon.run(stop)


def order_giver(mission: Mission, keys: KeyFiles, operator_key: Path | None) -> OrderGiver:
    """Return the giver of the orders that ground stations request.

    Raises:
        InputError: there is no operator's key.
    """
    by = KeyFiles(
        mission=keys.mission, key=operator_key, roster=keys.roster, insecure=keys.insecure
    ).of_operator()
    if by.roster is not None and by.key is None:
        raise InputError(
            f"{key_places(keys.mission).private(OPERATOR)}: there is no operator's private key to sign orders"
            " of a ground station with; copy it there, or name it with --operator-key"
        )
    name = f"{OPERATOR} of a ground station"
    if by.roster is not None and by.key is not None:
        name = operator_of(by.roster, by.key)
    return OrderGiver(mission, trust_in(mission, name, by))


def trust_in(mission: Mission, name: str, by: Credentials) -> Trust:
    """Return the trust of a new member of a mission's formation, by its keys."""
    return Trust(
        formation=mission.name,
        name=name,
        leader=mission.timekeeper,
        deputies=mission.deputies,
        session=new_session(),
        roster=by.roster,
        key=by.key,
    )


def leader_address(mission: Mission, vehicle: str, instead: str | None) -> Address | None:
    """Return the address of a leader without a companion, from the mission or `instead`; None for others.

    Raises:
        InputError: the address is invalid or of no use, or the vehicle is that leader.
    """
    if not mission.leader.is_foreign:
        if instead is not None:
            raise InputError(
                f"--leader: the leader of {mission.name} is heard over the link; leave it out, or write"
                " leader.follows: mavlink"
            )
        return None
    if vehicle == mission.leader.vehicle:
        raise InputError(
            f"{vehicle!r} flies without a companion in {mission.name}; name one of"
            f" {', '.join(mission.companions)}"
        )
    return parse_address(instead or mission.leader.connection or "")


def read_key(file: Path) -> bytes:
    """Read a signing key from a file, which should be readable for the companion's user alone.

    Raises:
        InputError: there is no such file, or no key in it.
    """
    try:
        return signing_key(file.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is no text"
        raise InputError(
            f"{file}: cannot be read ({reason}); give a file with a key of 64 hex digits"
            " with --signing-key-file"
        ) from error
    except InputError as error:
        raise InputError(f"{file}: {error}") from error


def parse_clock(text: str | None) -> Clock:
    """Parse `EPOCH,RATE`, with which a rehearsal starts its companions; None gives the real clock.

    Raises:
        InputError: it is not two numbers, or the rate is not above 0.
    """
    if text is None:
        return Clock()
    try:
        epoch_s, rate = (float(part) for part in text.split(","))
    except ValueError as error:
        raise InputError(f"--clock: {text!r} is not EPOCH,RATE") from error
    if not rate > 0.0:
        raise InputError(f"--clock: the rate {rate:g} is not above 0")
    return Clock(epoch_s=epoch_s, rate=rate)
