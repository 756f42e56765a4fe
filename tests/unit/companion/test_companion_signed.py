from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl_stub import Autopilot, CalmWind, Signing
from tests.kit.autopilot import config_of
from tests.kit.missions import shipped
from vfguide.companion.core import Companion
from vfguide.companion.mission_plan import adapter_of, flight_plan
from vfguide.companion.supervisor import Mode
from vfguide.mavlink.framing import ConnectionSigning
from vfguide.mission.model import Mission

KEY = bytes(range(32))
NOW_S = 1_800_000_000.0
STEP_S = 0.05
MANUAL = 0


class Pair:
    """A leader's companion and its autopilot on a connection that the autopilot has signed."""

    def __init__(self, mission: Mission, key: bytes | None) -> None:
        self.now = 0.0
        config = config_of(
            system_id=1,
            latitude_deg=47.397742,
            longitude_deg=8.545594,
            altitude_amsl_m=588.0,
            home_altitude_amsl_m=488.0,
        )
        signed = Signing(KEY)
        self.autopilot = Autopilot(
            config, CalmWind(), signing=signed, unix_time=lambda: NOW_S + self.now
        )
        name = mission.leader.vehicle
        self.companion = Companion(
            flight_plan(mission, name),
            adapter_of(mission.vehicles[name]),
            engage=True,
            signing=None if key is None else ConnectionSigning(key, lambda: NOW_S + self.now),
        )

    def fly(self, seconds: float, also: bytes = b"") -> None:
        replies = b""
        for _ in range(round(seconds / STEP_S)):
            telemetry = replies + self.autopilot.advance(self.now)
            out = self.companion.receive_mavlink(telemetry + also, self.now)
            replies = self.autopilot.receive(out.to_autopilot)
            self.now += STEP_S


def test_with_the_key_the_companion_is_obeyed():
    pair = Pair(shipped("line-calm"), KEY)
    pair.fly(30.0)
    assert pair.autopilot_mode == "GUIDED"
    assert pair.companion.snapshot.mode is Mode.TRACKING
    assert pair.autopilot.counters["not signed"] == 0


def test_without_it_nothing_that_is_said_is_obeyed():
    pair = Pair(shipped("line-calm"), None)
    pair.fly(5.0)
    assert pair.autopilot_mode == "LOITER"
    assert pair.autopilot.counters["not signed"] > 0


def test_a_forged_heartbeat_takes_the_aircraft_from_nobody():
    pair = Pair(shipped("line-calm"), KEY)
    pair.fly(30.0)
    forger = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    forged = mavlink.MAVLink_heartbeat_message(1, 3, 129, MANUAL, 4, 3).pack(forger)
    pair.fly(5.0, bytes(forged))
    assert pair.companion.snapshot.mode is Mode.TRACKING
