"""A formation in virtual time, with everything in hand that is between its parts."""

from collections.abc import Callable

from msgspec.structs import replace

import sitl_stub
from tests.kit.flight import Flight
from tests.kit.wire import command_long, packed, parsed
from vfguide.companion.core import Companion
from vfguide.companion.mission_plan import adapter_of, flight_plan
from vfguide.companion.role import Outgoing, Snapshot
from vfguide.lab.rehearsal.aircraft import Aircraft, aircraft_of
from vfguide.lab.rehearsal.recorder import flight_record
from vfguide.link.memory import Mail
from vfguide.mission import Mission
from vfguide.record.tlog import TelemetryLog

SET_MODE = 176
MANUAL, RTL, LOITER, GUIDED = 0, 11, 12, 15
"""Of ArduPlane."""

CHANGE_SPEED, CHANGE_HEADING = 43000, 43002

Carry = Callable[[list[Mail]], list[Mail]]
"""What is heard for what is said."""

Tell = Callable[[str, Mail, float], Mail]
"""What one aircraft, by its name, hears of a message at a time, s."""


class Pushed:
    """An emulated autopilot, and what a pilot and the wire to its companion do."""

    def __init__(self, autopilot: sitl_stub.Autopilot) -> None:
        self.autopilot = autopilot
        self.silent = False
        """Whether nothing that it sends arrives."""
        self.frozen = False
        """Whether it hangs: nothing in, nothing out, its surfaces where they are."""
        self.sent: list[bytes] = []
        """All that it was sent."""
        self._answers = b""

    def advance(self, to_s: float) -> bytes:
        said, self._answers = self._answers + self.autopilot.advance(to_s), b""
        return b"" if self.silent or self.frozen else said

    def receive(self, data: bytes) -> bytes:
        self.sent.append(data)
        if self.frozen:
            return b""
        said = self.autopilot.receive(data)
        return b"" if self.silent else said

    def truth(self) -> sitl_stub.Truth:
        return self.autopilot.truth()

    def freeze(self) -> None:
        self.frozen = True
        self.autopilot.hold_bank(self.truth().bank_rad)

    def select(self, mode: int, sub_mode: int = 0) -> list[int]:
        """Turn the pilot's switch; whoever listens hears of the new mode. Return the results."""
        order = command_long(SET_MODE, 1, mode, sub_mode, system_id=self.autopilot.system_id)
        answer = self.autopilot.receive(packed(order))
        self._answers += answer
        return [one.result for one in parsed(answer) if one.get_type() == "COMMAND_ACK"]

    @property
    def setpoints(self) -> int:
        """How many courses and speeds it was sent."""
        commands = (getattr(one, "command", None) for one in parsed(b"".join(self.sent)))
        return sum(one in {CHANGE_SPEED, CHANGE_HEADING} for one in commands)


class Dead:
    """A companion that is no more."""

    def __init__(self, snapshot: Snapshot) -> None:
        self.snapshot = snapshot

    def receive_link(self, data: bytes, now: float) -> None:
        del data, now

    def receive_neighbour(self, vehicle: str, data: bytes, now: float) -> None:
        del vehicle, data, now

    receive_reply = receive_lead = receive_neighbour

    def receive_order(self, data: bytes, signed: bytes, now: float, *, repeated: bool) -> None:
        del data, signed, now, repeated

    def receive_mavlink(self, data: bytes, now: float) -> Outgoing:
        del data, now
        return Outgoing()


class Formation:
    """All aircraft of a mission; what they say goes through `carry`."""

    def __init__(
        self,
        mission: Mission,
        *,
        logged: bool = False,
        carry: Carry = list,
        tell: Tell | None = None,
    ) -> None:
        self.mission = mission
        self.carry = carry
        self.tell = tell
        self.names = [mission.leader.vehicle, *mission.followers_by_name]
        self.aircraft = {}
        self.emulators: dict[str, Pushed] = {}
        for name in self.names:
            log = TelemetryLog(1.7e9) if logged else None
            self.add(name, aircraft_of(mission, name, log=log))
        self.times: list[float] = []
        self._mail: list[Mail] = []

    def add(self, name: str, aircraft: Aircraft) -> None:
        """Let an aircraft fly in the place of that name."""
        self.aircraft[name] = aircraft
        if isinstance(aircraft, Aircraft):
            self.emulators[name] = Pushed(aircraft.emulator)
            aircraft.emulator = self.emulators[name]

    @property
    def now(self) -> float:
        """Time of the next step, s."""
        return len(self.times) / self.mission.rehearsal.rate_hz

    def step(self) -> None:
        """One turn of each, leader first: it is heard at once, all others a step later."""
        mail, self._mail, now = self._mail, [], self.now
        for name, one in self.aircraft.items():
            heard = mail if self.tell is None else [self.tell(name, sent, now) for sent in mail]
            said = self.carry(one.step(now, heard))
            if one.leads:
                mail = [*mail, *said]
            else:
                self._mail += said
        self.times.append(now)

    def fly(self, until_s: float) -> Flight:
        """Fly on; return what has happened so far."""
        while self.now <= until_s:
            self.step()
        return self.flown()

    def flown(self) -> Flight:
        records = [one.recorder.record() for one in self.aircraft.values()]
        record = flight_record(self.mission, self.times, records, wall_s=0.0)
        return Flight(record, {name: one.events for name, one in self.aircraft.items()})

    def kill(self, name: str) -> None:
        """End a companion without a last word."""
        one = self.aircraft[name]
        one.companion = Dead(one.companion.snapshot)

    def restart(self, name: str) -> None:
        """Start a companion that knows nothing of the one before."""
        plan = flight_plan(self.mission, name)
        adapter = adapter_of(self.mission.vehicles[name])
        self.aircraft[name].companion = Companion(plan, adapter, engage=True)

    def link(self, **quality: float) -> None:
        """Change how well everybody hears the others."""
        for one in self.aircraft.values():
            link = one._link  # noqa: SLF001
            link.quality = replace(link.quality, **quality)

    def order_numbers(self) -> list[int]:
        """Return the number of the order that each flies."""
        found = [one.companion.arrangement for one in self.aircraft.values()]
        return [0 if one is None else one.number for one in found]

    def leaders(self) -> list[str]:
        """Return who leads, as each says of itself."""
        return [name for name, one in self.aircraft.items() if one.companion.snapshot.lead]

    def modes(self) -> set[str]:
        """Return what the followers' companions are doing."""
        followers = [one for one in self.aircraft.values() if not one.leads]
        return {one.companion.snapshot.mode.value for one in followers}

    def flight_modes(self) -> dict[str, str]:
        """Return the mode of each emulated autopilot."""
        return {name: one.truth().mode for name, one in self.emulators.items()}
