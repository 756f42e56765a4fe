"""An order back engages a vehicle that an order has left to its autopilot, and no pilot has had since."""

from unittest.mock import create_autospec

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.kit.companion import GUIDED, LOITER
from tests.kit.missions import shipped
from vfguide.companion.alerts import Alerts
from vfguide.companion.authority import EngageRule, ModeAuthority, Wish
from vfguide.companion.consent import MemoryStore
from vfguide.companion.flight_phase import FlightPhase
from vfguide.companion.mission_plan import adapter_of
from vfguide.companion.supervisor import Control
from vfguide.mavlink.reports import HeartbeatReport

ACTIVE, CRITICAL = mavlink.MAV_STATE_ACTIVE, mavlink.MAV_STATE_CRITICAL


def in_the_air() -> FlightPhase:
    """A flight that goes on all the time."""
    flight = create_autospec(FlightPhase, instance=True, is_over=False)
    flight.hear.return_value = flight.is_on_ground.return_value = False
    flight.flies.return_value = True
    flight.obstacle.return_value = None
    return flight


class Vehicle:
    """Heartbeats of an autopilot, and what they are answered with."""

    def __init__(self) -> None:
        self.alerts = Alerts()
        self.authority = ModeAuthority(
            adapter_of(shipped("line-calm").vehicles["f1"]),
            EngageRule(allowed=True, modes=("LOITER",)),
            MemoryStore(),
            in_the_air(),
            self.alerts,
        )

    def beat(self, mode: int, now: float, wish: Wish = Wish.NONE, status: int = ACTIVE) -> bool:
        """Whether a heartbeat is answered with a mode command."""
        report = HeartbeatReport(autopilot=3, custom_mode=mode, armed=True, status=status)
        self.authority.note_life(now)
        self.authority.hear(report, now)
        return bool(self.authority.commands(wish, now, age_s=0.1))

    def leave(self) -> None:
        """It is steered for 6 s, and handed back into a loiter; the last heartbeat at 11 s."""
        for now in range(6):
            self.beat(GUIDED, float(now))
            self.authority.note_steering()
        assert self.beat(GUIDED, 6.0, Wish.RETURN)
        for now in range(7, 12):
            self.beat(LOITER, float(now))
        assert self.authority.control(11.0) is Control.RETURNED

    def engages(self, from_s: int) -> bool:
        """Whether an order back leads to a command within 6 s."""
        self.authority.renew()
        return any(self.beat(LOITER, float(from_s + s), Wish.STEER) for s in range(6))


def test_a_vehicle_that_was_watched_all_the_time_is_engaged_again():
    vehicle = Vehicle()
    vehicle.leave()
    assert vehicle.engages(12)


def unheard(vehicle: Vehicle) -> None:
    """A minute without telemetry, in which a pilot may have flown and loitered again."""
    for now in range(72, 80):
        vehicle.beat(LOITER, float(now))


def rebooted(vehicle: Vehicle) -> None:
    vehicle.authority.rebooted()
    vehicle.beat(LOITER, 12.0)


def failing(vehicle: Vehicle) -> None:
    vehicle.beat(LOITER, 12.0, status=CRITICAL)


@pytest.mark.parametrize(("happens", "from_s"), [(unheard, 80), (rebooted, 13), (failing, 13)])
def test_a_vehicle_is_left_to_its_pilot_after_what_ends_the_right_to_engage_it(happens, from_s):
    vehicle = Vehicle()
    vehicle.leave()
    happens(vehicle)
    assert not vehicle.engages(from_s)
    assert vehicle.authority.control(from_s + 5.0) is Control.PILOT
    said = [one.text for one in vehicle.alerts.heard(from_s + 5.0)]
    assert any(text.startswith("ordered back into the formation: select GUIDED") for text in said)
