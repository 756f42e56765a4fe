"""What goes wrong on a flight, by name."""

import signal
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tests.autopilots.formation import Formation

GLITCH_M = 50.0


@dataclass(frozen=True, slots=True)
class Step:
    """Something happens, so many seconds after the fault has begun."""

    after_s: float
    act: Callable[["Formation"], None]


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault and its end."""

    what: str
    """In a table."""
    steps: tuple[Step, ...]
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


def kill(vehicle: str) -> Callable[["Formation"], None]:
    """The power of a companion is lost."""
    return lambda formation: formation.companions[vehicle].kill()


def restart(vehicle: str) -> Callable[["Formation"], None]:
    """A companion is started anew, as systemd does it."""
    return lambda formation: formation.companions[vehicle].start()


def send(vehicle: str, number: signal.Signals) -> Callable[["Formation"], None]:
    """A signal to a vehicle's autopilot."""
    return lambda formation: formation.simulators[vehicle].program.signal(number)


def pilot(vehicle: str, mode: str) -> Callable[["Formation"], None]:
    """The pilot selects a mode."""
    return lambda formation: formation.simulators[vehicle].enter(mode)


def guided(vehicle: str) -> Callable[["Formation"], None]:
    """The pilot gives a vehicle back to its companion."""
    return lambda formation: formation.give(vehicle)


def glitch(vehicle: str, north_m: float) -> Callable[["Formation"], None]:
    """A vehicle's satellite receiver is off by this much."""
    return lambda formation: formation.simulators[vehicle].glitch(north_m)


def ordered(words: str) -> Fault:
    """An operator's program gives an order, such as "vee" or "vee --spacing 30"."""
    return Fault(
        f"order: {words}", (Step(0.0, lambda formation: formation.order(words)),), ends_after_s=0.0
    )


def faults(leader: str, follower: str) -> Mapping[str, Fault]:
    """All faults by name, of these two vehicles."""
    return {
        "companion-restart": Fault(
            "a follower's companion killed, started again after 5 s",
            (Step(0.0, kill(follower)), Step(5.0, restart(follower))),
            ends_after_s=5.0,
        ),
        "leader-companion-restart": Fault(
            "the leader's companion killed, started again after 5 s",
            (Step(0.0, kill(leader)), Step(5.0, restart(leader))),
            ends_after_s=5.0,
        ),
        "leader-companion-gone": Fault(
            "the leader's companion killed for good", (Step(0.0, kill(leader)),), ends_after_s=60.0
        ),
        "leader-lost": Fault(
            "the leader's companion killed for good, with deputies",
            (Step(0.0, kill(leader)),),
            ends_after_s=0.0,
        ),
        "pilot-loiter": Fault(
            "a follower's pilot selects LOITER for 10 s",
            (Step(0.0, pilot(follower, "LOITER")), Step(10.0, guided(follower))),
            ends_after_s=10.0,
        ),
        "pilot-rtl-restart": Fault(
            "a follower's pilot selects RTL, its companion is killed and started again after 5 s",
            (
                Step(0.0, pilot(follower, "RTL")),
                Step(2.0, kill(follower)),
                Step(7.0, restart(follower)),
            ),
            ends_after_s=7.0,
            without=(follower,),
        ),
        "leader-frozen": Fault(
            "the leader's autopilot hangs for 5 s",
            (Step(0.0, send(leader, signal.SIGSTOP)), Step(5.0, send(leader, signal.SIGCONT))),
            ends_after_s=5.0,
        ),
        "broker-gone": Fault(
            "the broker gone for 20 s",
            (
                Step(0.0, lambda formation: formation.broker.kill()),
                Step(20.0, lambda formation: formation.broker.start()),
            ),
            ends_after_s=20.0,
        ),
        "gps-glitch": Fault(
            f"a follower's position steps by {GLITCH_M:.0f} m for 3 s",
            (Step(0.0, glitch(follower, GLITCH_M)), Step(3.0, glitch(follower, 0.0))),
            ends_after_s=3.0,
        ),
        "leader-gps-glitch": Fault(
            f"the leader's position steps by {GLITCH_M:.0f} m for 3 s",
            (Step(0.0, glitch(leader, GLITCH_M)), Step(3.0, glitch(leader, 0.0))),
            ends_after_s=3.0,
        ),
        "leader-gps-wrong": Fault(
            f"the leader's position is {GLITCH_M:.0f} m off for good",
            (Step(0.0, glitch(leader, GLITCH_M)),),
            ends_after_s=60.0,
        ),
    }
