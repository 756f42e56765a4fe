"""Link over a telemetry radio on a serial port: all others hear what one member sends.

Turns are in `radio_schedule`, packets in `packed`, and one member's part in `radio_station`; here are the
port and the clock.
"""

import asyncio
import errno
import math
import os
import termios
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar
from urllib.parse import SplitResult, parse_qsl, unquote

import serial

from vfguide.errors import InputError
from vfguide.link.carrier import DatagramCarrier, LinkAddress, link
from vfguide.link.keys import RADIO_KEY, read_radio_key
from vfguide.link.member import Member, Parcel
from vfguide.link.packed import MOST_VEHICLES
from vfguide.link.presence import Presence
from vfguide.link.radio_schedule import LARGEST_FRAME, Channel, Turn, make_timetable
from vfguide.link.radio_station import GREETING_S, ORDER_LEAD_S, PRESENCE_S, Station

EXAMPLE = f"serial:///dev/ttyUSB1:57600?key=MISSION.keys/{RADIO_KEY}"

SLOWEST_BAUD, FASTEST_BAUD = 1_200, 12_000_000

RATES = {"leader": 10.0, "followers": 2.5, "air": 4000.0}
"""Defaults: states per second of the leader and of each follower, used by the leader alone, and bytes per
second of all radios together."""

READ = 4096
"""Maximum number of bytes per read."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RadioAddress(LinkAddress):
    """Serial port of a radio, and the rates on it."""

    scheme: ClassVar[str] = "serial"

    device: str
    """Device file of the serial port."""
    channel: Channel
    """Speed of the serial line and of the radio."""
    key: Path | None = None
    """File with the formation's radio key."""
    leader_hz: float = RATES["leader"]
    """States per second of the leader."""
    followers_hz: float = RATES["followers"]
    """States per second of each follower."""

    def __str__(self) -> str:
        return f"serial://{self.device}:{self.channel.baud}"


def _number(name: str, text: str) -> float:
    greatest = 1e6 if name == "air" else 50.0
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not 0.1 <= number <= greatest:
        raise InputError(f"{name}= must be within 0.1 to {greatest:g}, such as {RATES[name]:g}")
    return number


def vehicles_of(member: Member) -> tuple[str, ...]:
    """Return the vehicles' names by their numbers on the radio: the leader, then the others by name.

    Raises:
        InputError: a watcher does not know them, or they are too many.
    """
    leader = member.trust.leader
    if member.watches and not member.neighbours:
        names = member.trust.vehicles
        if not names:
            raise InputError(
                "on a radio only a roster tells the names of those who are heard: give --roster"
            )
    else:
        own = set() if member.watches else {member.name}
        names = (leader, *sorted({*own, *member.neighbours} - {leader}))
    if len(names) > MOST_VEHICLES:
        raise InputError(f"a radio carries {MOST_VEHICLES} vehicles at most, not {len(names)}")
    return names


@link("serial")
class RadioCarrier(DatagramCarrier):
    """Carrier over a radio."""

    address: RadioAddress
    presence_s = PRESENCE_S
    order_lead_s = ORDER_LEAD_S
    greeting_s = GREETING_S

    def prepare(self) -> None:
        """Assign numbers to the vehicles, and read the radio key.

        Raises:
            InputError: the key is missing or the formation too large.
        """
        super().prepare()
        address, member = self.address, self._member
        vehicles = vehicles_of(member)
        timetable = make_timetable(
            len(vehicles),
            leader_hz=address.leader_hz,
            followers_hz=address.followers_hz,
            channel=address.channel,
        )
        self._station = Station(
            member,
            formation=self._formation,
            vehicles=vehicles,
            key=radio_key(address, signs=member.trust.signs),
            channel=address.channel,
            timetable=timetable if member.trust.leads else None,
        )
        self._port: serial.Serial | None = None
        self._timer: asyncio.TimerHandle | None = None

    @classmethod
    def address_of(cls, parts: SplitResult, environment: Mapping[str, str]) -> RadioAddress:
        """Build a port from serial:///dev/ttyUSB1:57600?key=circle.keys/radio.psk&leader=10&followers=2.5."""
        del environment
        # The last colon, since names under /dev/serial/by-path have colons of their own.
        device, separator, speed = unquote(parts.path).rpartition(":")
        if parts.netloc or parts.fragment or not separator or device.endswith("/"):
            raise InputError(f"a radio has a device file and a baud rate; write {EXAMPLE}")
        if not (speed.isascii() and speed.isdigit() and len(speed) <= 8):
            raise InputError(f"the baud rate is missing; write {EXAMPLE}")
        if not SLOWEST_BAUD <= int(speed) <= FASTEST_BAUD:
            raise InputError(f"the baud rate must be within {SLOWEST_BAUD} to {FASTEST_BAUD}")
        pairs = parse_qsl(parts.query, keep_blank_values=True)
        options = dict(pairs)
        if not set(options) <= {"key", *RATES} or len(options) < len(pairs):
            raise InputError(
                f"after the ? come key=, leader=, followers= and air=, once each; write {EXAMPLE}"
            )
        key = options.pop("key", None)
        if key is not None and not (key and key.isprintable()):
            raise InputError(f"key= names no file; write {EXAMPLE}")
        numbers = RATES | {name: _number(name, text) for name, text in options.items()}
        return RadioAddress(
            device=device,
            channel=Channel(baud=int(speed), air_bytes_s=numbers["air"]),
            key=None if key is None else Path(key),
            leader_hz=numbers["leader"],
            followers_hz=numbers["followers"],
        )

    def open(self) -> None:
        """Open the port, for this process alone."""
        try:
            self._port = serial.Serial(
                self.address.device, self.address.channel.baud, timeout=0, exclusive=True
            )
        except termios.error as error:
            # pyserial lets this through when a port disappears while it is being opened.
            raise OSError(*error.args) from error
        with suppress(OSError, ValueError, AttributeError):
            # Adapters otherwise hold received bytes for up to 16 ms.
            self._port.set_low_latency_mode(True)
        loop = asyncio.get_running_loop()
        self._station.begin(loop.time())
        loop.add_reader(self._port.fileno(), self._read)
        self._plan()

    def close(self) -> None:
        """Close the port."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        port, self._port = self._port, None
        if port is not None:
            asyncio.get_running_loop().remove_reader(port.fileno())
            with suppress(OSError, termios.error):
                # Closing would wait for the bytes that the kernel still holds.
                port.reset_output_buffer()
            with suppress(OSError, termios.error):
                port.close()

    def send(self, parcel: Parcel) -> None:
        """Queue a message for the next turn."""
        if self._port is None:
            self.status.counters["dropped: not connected"] += 1
        else:
            self._station.post(parcel, asyncio.get_running_loop().time())

    def say(self, presence: Presence) -> None:
        """Update the presence, sent now and then; a goodbye would wait for a turn and is omitted."""
        self._station.announce(presence)

    def transmit(self, data: bytes) -> None:
        """Write a packet; drop it if an earlier one has not gone out yet, which would make it late."""
        if self._port is None:
            return
        if self._port.out_waiting > LARGEST_FRAME:
            raise BlockingIOError
        os.write(self._port.fileno(), data)

    def _read(self) -> None:
        if self._port is None:
            return
        try:
            data = os.read(self._port.fileno(), READ)
        except BlockingIOError:
            return
        except OSError as error:
            self.broke(error)
            data = b""
        if not data:
            asyncio.get_running_loop().remove_reader(self._port.fileno())
            self.broke(OSError(errno.ENODEV, "the radio is gone"))
            return
        if self._station.hear(data, asyncio.get_running_loop().time()):
            self.heard()
        self._plan()

    def _plan(self) -> None:
        """Schedule the next turn; received bytes move it, unless it is due already."""
        loop = asyncio.get_running_loop()
        now = loop.time()
        if self._timer is not None:
            if self._timer.when() <= now:
                return
            self._timer.cancel()
        turn = self._station.next_turn(now)
        self._timer = None if turn is None else loop.call_at(turn.at_s, self._take_turn, turn)

    def _take_turn(self, turn: Turn) -> None:
        """Send the packet of a turn, if there is one."""
        self._timer = None
        now = max(asyncio.get_running_loop().time(), turn.at_s)
        try:
            data = self._station.speak(turn, now)
            if data:
                self._send(data)
        finally:
            self._plan()


def radio_key(address: RadioAddress, *, signs: bool) -> bytes:
    """Return the radio key, empty with --insecure.

    Raises:
        InputError: it is missing where needed, or given where not.
    """
    if not signs:
        if address.key is not None:
            raise InputError("--insecure: nothing is signed; leave key= out of the radio's address")
        return b""
    if address.key is None:
        raise InputError(
            f"a radio needs the formation's radio key, which `vfguide keys make` makes; write {EXAMPLE}"
        )
    return read_radio_key(address.key)
