"""Random pilots against companions that are killed, hang, go deaf and are lied to: is any mode undone?

    python -m tests.benchmarks.authority ACTIONS

Real MAVLink bytes, an emulated autopilot, virtual time. A mode that pilot or fail-safe has selected is undone
where a command of the companion changes it. Guided, selected by the pilot, and the one engaging of a flight,
out of the mode that it began in, are none; nor is what was selected less than 2 s ago while telemetry is
late: nobody can know of it. A vehicle that a new companion leaves in its guided mode although it hears no
leader counts as well. Prints what happened how often; exit status 1 if any was undone.
"""

import math
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from random import Random

from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl_stub import Autopilot
from tests.kit.autopilot import REAL32
from tests.kit.companion import MODES, PX4_NAMES, emulator, leader_bytes
from tests.kit.figures import tell
from tests.kit.missions import mission_with, shipped
from tests.kit.wire import command_long, packed, parsed, position_report, spoken
from vfguide.companion.consent import MemoryStore
from vfguide.companion.core import Companion
from vfguide.companion.mission_plan import adapter_of, flight_plan

MISSION = shipped("line-calm")

RATE_HZ = 10.0
STEPS_A_FLIGHT = 40
"""Actions in one flight: then everything is new."""

SYSTEM_ID = 2

ACTIONS = (
    *("select",) * 8,
    *("select_guided",) * 3,
    *("restart", "kill", "stop", "hang", "go_deaf", "lose_uplink", "silence_leader"),
    *("reboot", "disarm", "forge_guided", "forge_reboot", "forge_answer"),
    *("delay_telemetry", "replace"),
)
"""What happens, as often as it is named."""

CROSSED_S = 2.0
"""A command and a pilot's mode may cross on their way for so long."""

LEFT_S = 25.0
"""After so long nobody steers a vehicle that is still in its guided mode."""

LENGTHS_S = (0.1, 0.3, 0.7, 1.3, 2.6, 4.0, 8.0)
"""Until the next thing happens."""


class Encounter:
    """One vehicle with its companion, and everything that happens to them."""

    def __init__(self, seed: int, kind: str) -> None:
        self._random = Random(f"{seed} {kind}")
        self._kind = kind
        self._vehicle = MISSION.vehicles["f1"].model_copy(update={"autopilot": kind})
        self._engage = self._random.random() < 0.8
        hasty = mission_with("line-calm", patience={"prediction_s": 4.0, "breakaway_s": 2.0})
        self._plan = flight_plan(hasty, "f1")
        self._store = MemoryStore()
        self.counts: Counter[str] = Counter()
        self.undone: list[str] = []
        self._now = self._booted = 0.0
        self._autopilot = self._new_autopilot()
        self._companion: Companion | None = self._new_companion()
        self._waiting = b""
        self._late_s, self._late_until = 0.0, -math.inf
        self._under_way: list[tuple[float, bytes]] = []
        self._selected = -math.inf
        self._deaf_until = self._mute_until = self._silent_until = -math.inf
        self._stood_until = self._blank_until = -math.inf
        self._blank_place: tuple[int, int, int] | None = None
        self._forged_until = -math.inf
        self._forged: Callable[[], bytes] = bytes
        self._pilots_mode = self._engaged_once = False
        self._history: list[str] = []

    def run(self, actions: int) -> None:
        """Let so many things happen."""
        self._fly(self._random.choice([0.1, 0.7, 3.0]))
        for _ in range(actions):
            self.do(self._random.choice(ACTIONS), self._random.choice(LENGTHS_S))

    def do(self, action: str, length_s: float) -> None:
        """Let one thing happen, and fly on for some time."""
        self.counts[action] += 1
        self._history.append(f"{self._now:.1f} {action}")
        getattr(self, f"_{action}")()
        self._fly(length_s)

    @property
    def _mode(self) -> str:
        mode = self._autopilot.truth().mode
        return PX4_NAMES.get(mode, mode)

    def _new_companion(self) -> Companion:
        return Companion(
            replace(self._plan), adapter_of(self._vehicle), engage=self._engage, consent=self._store
        )

    def _new_autopilot(self) -> Autopilot:
        autopilot = emulator(self._kind, SYSTEM_ID)
        for name, value in (
            (b"FS_GCS_ENABL", 1.0),
            (b"FS_LONG_ACTN", 1.0),
            (b"MAV_GCS_SYSID", 2.0),
        ):
            if self._kind == "ardupilot":
                message = mavlink.MAVLink_param_set_message(2, 1, name, value, REAL32)
                autopilot.receive(packed(message))
        return autopilot

    def _leader(self) -> bytes:
        latitude, longitude = self._plan.frame.to_geodetic(0.0, 20.0 * self._now)
        east = math.pi / 2.0
        return leader_bytes(self._now, latitude_deg=latitude, longitude_deg=longitude, course=east)

    def _fly(self, length_s: float) -> None:
        for _ in range(max(1, round(length_s * RATE_HZ))):
            self._now = round(self._now + 1.0 / RATE_HZ, 6)
            before = self._mode
            said = self._blanked(self._autopilot.advance(self._now - self._booted))
            if self._mode != before:
                self._pilots_mode = True
                self._selected = self._now
            self._send(said)
            while self._under_way and self._under_way[0][0] <= self._now:
                self._waiting += self._under_way.pop(0)[1]
            if self._now <= self._forged_until:
                self._waiting += self._forged()
            if self._companion is None or self._now < self._stood_until:
                continue
            if self._now >= self._silent_until:
                self._companion.receive_link(self._leader(), self._now)
            heard, self._waiting = self._waiting, b""
            # A buffer is read piece by piece.
            for piece in pieces(heard):
                self._deliver(self._companion.receive_mavlink(piece, self._now).to_autopilot)
            self._deliver(self._companion.poll(self._now).to_autopilot)

    def _send(self, said: bytes) -> None:
        """What the autopilot says goes on its way, in its order."""
        if self._now >= self._deaf_until:
            late_s = self._late_s if self._now < self._late_until else 0.0
            self._under_way.append((self._now + late_s, said))

    @property
    def _undisturbed(self) -> bool:
        """Whether everything that is said arrives, and nothing else."""
        disturbed = (self._deaf_until, self._mute_until, self._stood_until, self._blank_until)
        return self._now > max(*disturbed, self._late_until, self._forged_until)

    def _blanked(self, said: bytes) -> bytes:
        """What an autopilot says while it comes up: disarmed, and no position or one without a velocity."""
        if self._now >= self._blank_until:
            return said
        blank = [coming_up(message, self._blank_place) for message in parsed(said)]
        return spoken(*(message for message in blank if message is not None))

    def _deliver(self, data: bytes) -> None:
        """What the companion says reaches the autopilot; does it change a mode that is not its to change?"""
        if self._now < self._mute_until:
            return
        before = self._mode
        self._send(self._autopilot.receive(data))
        after = self._mode
        if after == before:
            return
        if before == "GUIDED":
            self.counts["handed back"] += 1
            self._pilots_mode = False
            return
        # The one engaging of a flight, out of the mode that it began in and nobody has changed.
        first = after == "GUIDED" and not self._engaged_once and before == "LOITER"
        if first and not self._pilots_mode and self._engage:
            self.counts["engaged by itself"] += 1
            self._engaged_once = True
            return
        if self._now - self._selected < CROSSED_S and self._now < self._late_until + CROSSED_S:
            self.counts["crossed on the way"] += 1
            return
        self.undone.append(f"{before} -> {after} after {self._history[-6:]}")

    def _commanded(self, number: int, *parameters: float) -> bytes:
        """Send a command as a ground station; what is answered."""
        return self._autopilot.receive(
            packed(command_long(number, *parameters, system_id=SYSTEM_ID))
        )

    def _pilot(self, main: int, sub: int) -> None:
        before = self._mode
        self._send(self._commanded(mavlink.MAV_CMD_DO_SET_MODE, 1, main, sub))
        if self._mode != before:
            self._selected = self._now
            self._pilots_mode = self._mode != "GUIDED"
            self._engaged_once = True

    def _select(self) -> None:
        modes = MODES[self._kind]
        self._pilot(*modes[self._random.choice([name for name in modes if name != "GUIDED"])])

    def _select_guided(self) -> None:
        self._pilot(*MODES[self._kind]["GUIDED"])

    def _restart(self) -> None:
        self._companion, self._waiting, self._under_way = self._new_companion(), b"", []

    def _kill(self) -> None:
        self._companion = None
        self._fly(self._random.choice([0.5, 2.0, 7.0]))
        self._select()
        self._fly(self._random.choice([0.2, 2.0, 5.0]))
        self._restart()

    def _delay_telemetry(self) -> None:
        """As in the buffer of a radio."""
        self._late_s = self._random.choice([0.5, 1.0, 1.5, 2.0, 3.0])
        self._late_until = self._now + self._random.choice([4.0, 15.0])

    def _replace(self) -> None:
        """The leader falls silent, and another companion takes this one's place."""
        steers = self._companion is not None and self._companion.snapshot.mode.steers
        checked = steers and self._undisturbed
        self._silent_until = self._now + LEFT_S + 9.0
        self._companion = None
        self._fly(self._random.choice([0.5, 2.0, 3.5]))
        self._restart()
        self._fly(LEFT_S)
        if checked and self._mode == "GUIDED":
            self.undone.append(f"left in {self._mode} after {self._history[-6:]}")

    def _go_deaf(self) -> None:
        self._deaf_until = self._now + self._random.choice([1.5, 4.0, 15.0])

    def _lose_uplink(self) -> None:
        self._mute_until = self._now + self._random.choice([1.5, 4.0, 15.0])

    def _hang(self) -> None:
        self._stood_until = self._now + self._random.choice([1.0, 3.0, 20.0])
        if self._random.random() < 0.7:
            self._fly(0.3)
            self._select()
            self._fly(self._stood_until - self._now)

    def _stop(self) -> None:
        if self._companion is None:
            return
        if self._random.random() < 0.5:
            self._select()
        self._deliver(self._companion.stop(self._now).to_autopilot)
        self._fly(self._random.choice([0.3, 2.0, 6.0]))
        self._restart()

    def _reboot(self) -> None:
        """In the air; what is said before is lost, and the mode that it comes up in is nobody's to change."""
        before = self._mode
        self._commanded(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1)
        self._blank_until = self._now + self._random.choice([0.0, 3.0, 12.0])
        position = MISSION.origin
        place = (position.latitude_deg * 1e7, position.longitude_deg * 1e7, 588e3)
        here = (round(place[0]), round(place[1]), round(place[2]))
        ground = (here[0], here[1], round(position.altitude_amsl_m * 1e3))
        self._blank_place = self._random.choice([None, (0, 0, 0), here, ground])
        self._pilots_mode = self._pilots_mode or self._mode != before
        self._engaged_once = self._engaged_once or self._pilots_mode

    def _forge(self, forged: Callable[[], bytes]) -> None:
        self._forged, self._forged_until = forged, self._now + self._random.choice([0.2, 2.0, 6.0])

    def _forge_guided(self) -> None:
        main, sub = MODES[self._kind]["GUIDED"]
        firmware, mode = (3, main) if self._kind == "ardupilot" else (12, sub << 24 | main << 16)
        message = mavlink.MAVLink_heartbeat_message(1, firmware, 129, mode, 4, 3)
        self._forge(lambda: spoken(message))

    def _forge_reboot(self) -> None:
        began = self._now

        def position() -> bytes:
            since_ms = round((self._now - began) * 1e3)
            return spoken(position_report(time_boot_ms=since_ms, vx=2000))

        self._forge(position)

    def _forge_answer(self) -> None:
        message = mavlink.MAVLink_command_ack_message(mavlink.MAV_CMD_DO_SET_MODE, 0)
        self._forge(lambda: spoken(message))

    def _silence_leader(self) -> None:
        self._silent_until = self._now + self._random.choice([2.0, 9.0])

    def _disarm(self) -> None:
        for armed, force, length_s in ((0, 21196, 8.0), (1, 2989, 0.1)):
            self._send(self._commanded(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, armed, force))
            self._fly(length_s)


def coming_up(
    message: mavlink.MAVLink_message, place: tuple[int, int, int] | None
) -> mavlink.MAVLink_message | None:
    """A message as an autopilot sends it that is not ready yet: its place in 1e-7 degrees and mm, if any."""
    match message.get_type():
        case "HEARTBEAT":
            base = message.base_mode & ~mavlink.MAV_MODE_FLAG_SAFETY_ARMED
            said = message.type, message.autopilot, base, message.custom_mode
            return mavlink.MAVLink_heartbeat_message(*said, mavlink.MAV_STATE_BOOT, 3)
        case "EXTENDED_SYS_STATE":
            return mavlink.MAVLink_extended_sys_state_message(0, mavlink.MAV_LANDED_STATE_ON_GROUND)
        case "GLOBAL_POSITION_INT":
            if place is None:
                return None
            return mavlink.MAVLink_global_position_int_message(
                message.time_boot_ms, *place, 0, 0, 0, 0, 0
            )
    return message


def pieces(data: bytes) -> Iterator[bytes]:
    """Datagrams of some hundred bytes, cut between frames."""
    frames = [bytes(message.get_msgbuf()) for message in parsed(data)]
    for start in range(0, len(frames), 4):
        yield b"".join(frames[start : start + 4])


def meet(actions: int, seed: int) -> tuple[Counter[str], list[str]]:
    """Flights until so many things have happened: (what happened how often, what was undone)."""
    counts: Counter[str] = Counter()
    undone: list[str] = []
    flight = 0
    while actions > 0:
        encounter = Encounter(seed + flight, "px4" if flight % 4 == 3 else "ardupilot")
        encounter.run(min(actions, STEPS_A_FLIGHT))
        counts += encounter.counts
        undone += [f"flight {flight}: {one}" for one in encounter.undone]
        actions -= STEPS_A_FLIGHT
        flight += 1
    return counts, undone


def main() -> int:
    """Let so many things happen; the exit status is 1 if a mode was undone."""
    counts, undone = meet(int(sys.argv[1]), seed=1)
    for name, count in sorted(counts.items()):
        tell(f"{count:7d}  {name}")
    tell("\n".join([*(f"UNDONE {one}" for one in undone), f"{len(undone)} undone"]))
    return int(bool(undone))


if __name__ == "__main__":
    sys.exit(main())
