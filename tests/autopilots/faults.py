"""What goes wrong on a flight, by name."""

import signal
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tests.autopilots.formation import Formation

GLITCH_M = 50.0

Act = Callable[["Formation"], None]


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault and its end."""

    what: str
    """In a table."""
    steps: tuple[tuple[float, Act], ...]
    """What happens, each so many seconds after the fault has begun."""
    ends_after_s: float
    """From when on a formation can become whole again."""
    without: tuple[str, ...] = ()
    """Followers that fly for themselves afterwards and keep no slot."""


@dataclass(frozen=True, slots=True)
class Occurrence:
    """A fault at its time in a flight."""

    fault: Fault
    began_s: float
    """After the pilots had selected the guided mode."""

    @property
    def ended_s(self) -> float:
        """From when on the formation can become whole again."""
        return self.began_s + self.fault.ends_after_s


def kill(vehicle: str) -> Act:
    """The power of a companion is lost."""
    return lambda formation: formation.companions[vehicle].kill()


def restart(vehicle: str) -> Act:
    """A companion is started anew, as systemd does it."""
    return lambda formation: formation.companions[vehicle].start()


def send(vehicle: str, number: signal.Signals) -> Act:
    """A signal to a vehicle's autopilot."""
    return lambda formation: formation.simulators[vehicle].program.signal(number)


def pilot(vehicle: str, mode: str) -> Act:
    """The pilot selects a mode."""
    return lambda formation: formation.simulators[vehicle].enter(mode)


def glitch(vehicle: str, north_m: float) -> Act:
    """A vehicle's satellite receiver is off by this much."""
    return lambda formation: formation.simulators[vehicle].glitch(north_m)


def ordered(words: str) -> Fault:
    """An operator's program gives an order, such as "vee" or "vee --spacing 30"."""
    return Fault(f"order: {words}", ((0.0, lambda formation: formation.order(words)),), 0.0)


def faults(leader: str, follower: str) -> Mapping[str, Fault]:
    """All faults by name, of these two vehicles."""
    off = f"position steps by {GLITCH_M:.0f} m for 3 s"
    frozen = ((0.0, send(leader, signal.SIGSTOP)), (5.0, send(leader, signal.SIGCONT)))
    return {
        "companion-restart": Fault(
            "a follower's companion killed, started again after 5 s",
            ((0.0, kill(follower)), (5.0, restart(follower))),
            5.0,
        ),
        "leader-companion-restart": Fault(
            "the leader's companion killed, started again after 5 s",
            ((0.0, kill(leader)), (5.0, restart(leader))),
            5.0,
        ),
        "leader-companion-gone": Fault(
            "the leader's companion killed for good", ((0.0, kill(leader)),), 60.0
        ),
        "leader-lost": Fault(
            "the leader's companion killed for good, with deputies", ((0.0, kill(leader)),), 0.0
        ),
        "pilot-loiter": Fault(
            "a follower's pilot selects LOITER for 10 s",
            ((0.0, pilot(follower, "LOITER")), (10.0, lambda flown: flown.give(follower))),
            10.0,
        ),
        "pilot-rtl-restart": Fault(
            "a follower's pilot selects RTL, its companion is killed and started again after 5 s",
            ((0.0, pilot(follower, "RTL")), (2.0, kill(follower)), (7.0, restart(follower))),
            7.0,
            without=(follower,),
        ),
        "leader-frozen": Fault("the leader's autopilot hangs for 5 s", frozen, 5.0),
        "broker-gone": Fault(
            "the broker gone for 20 s",
            ((0.0, lambda flown: flown.broker.kill()), (20.0, lambda flown: flown.broker.start())),
            20.0,
        ),
        "gps-glitch": Fault(
            f"a follower's {off}",
            ((0.0, glitch(follower, GLITCH_M)), (3.0, glitch(follower, 0.0))),
            3.0,
        ),
        "leader-gps-glitch": Fault(
            f"the leader's {off}",
            ((0.0, glitch(leader, GLITCH_M)), (3.0, glitch(leader, 0.0))),
            3.0,
        ),
        "leader-gps-wrong": Fault(
            f"the leader's position is {GLITCH_M:.0f} m off for good",
            ((0.0, glitch(leader, GLITCH_M)),),
            60.0,
        ),
    }
