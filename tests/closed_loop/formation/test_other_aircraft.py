"""Aircraft that are not of the formation, reported as ADSB_VEHICLE, and a vehicle beside them.

The leader of `line-calm` flies from the origin to the north-east at 20 m/s, alone. After t seconds it is at
20 t along its line. What meets it is where it will be at 30 s, 600 m along, at that time.
"""

import cmath
import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.kit.missions import IN_PLACE, content_of, mission_with, replaced
from vfguide.companion.mission_plan import local_frame
from vfguide.lab.rehearsal.aircraft import Aircraft
from vfguide.mission import Mission

MEETS_S, MEETS_M = 30.0, 600.0
RATE_HZ = 20.0


class Intruder:
    """Flies straight, so that it and the leader would be at one place at 30 s."""

    def __init__(self, mission: Mission, *, course_deg: float, speed: float, up_m: float) -> None:
        self._frame = local_frame(mission)
        self._velocity = cmath.rect(speed, math.radians(course_deg))
        self._meets = cmath.rect(MEETS_M, math.radians(45.0))
        self._altitude = 588.0 + up_m
        self.system_id = 1

    def place(self, now: float) -> complex:
        """North + j east, m."""
        return self._meets + self._velocity * (now - MEETS_S)

    def report(self, now: float) -> bytes:
        """As the leader's autopilot passes it on."""
        place = self.place(now)
        latitude, longitude = self._frame.to_geodetic(place.real, place.imag)
        course = math.degrees(cmath.phase(self._velocity)) % 360.0
        valid = ("COORDS", "ALTITUDE", "HEADING", "VELOCITY")
        message = mavlink.MAVLink_adsb_vehicle_message(
            *(0x4B1900, round(latitude * 1e7), round(longitude * 1e7)),
            *(mavlink.ADSB_ALTITUDE_TYPE_GEOMETRIC, round(self._altitude * 1e3)),
            *(round(course * 1e2), round(abs(self._velocity) * 1e2), 0, b"HB123", 1, 0),
            sum(getattr(mavlink, f"ADSB_FLAGS_VALID_{name}") for name in valid),
            0,
        )
        return bytes(message.pack(mavlink.MAVLink(None, srcSystem=1, srcComponent=1)))


def nearest_m(mission: Mission, **intruder: float) -> tuple[float, str]:
    """Least distance, level, of the leader and an intruder; and what its companion has said."""
    leader, other = Aircraft(mission, "leader"), Intruder(mission, **intruder)
    times = [step / RATE_HZ for step in range(round(45.0 * RATE_HZ) + 1)]
    for step, now in enumerate(times):
        if step % 20 == 0:
            leader._replies += other.report(now)  # noqa: SLF001 - the autopilot says it once a second
        leader.step(now, [])
    record = leader.recorder.record()
    places = record.north_m + 1j * record.east_m
    distances = [abs(place - other.place(now)) for now, place in zip(times, places, strict=True)]
    return float(min(distances)), "\n".join(event.text for event in leader.events)


def alone(traffic_m: float) -> Mission:
    """The leader on its line from the origin, which keeps so many metres from others."""
    mission = mission_with("line-calm", rehearsal={"start": {"leader": IN_PLACE["leader"]}})
    leader = {"leader": content_of(mission)["vehicles"]["leader"]}
    return replaced(mission, followers=[], vehicles=leader, avoidance={"traffic_m": traffic_m})


@pytest.mark.parametrize(
    ("course_deg", "speed"),
    [(225.0, 40.0), (135.0, 30.0), (315.0, 50.0)],
    ids=["ahead", "left", "right"],
)
def test_an_aircraft_that_would_be_met_is_kept_clear_of(course_deg, speed):
    """Without looking at it the two meet: within a metre, as both fly straight."""
    met, _ = nearest_m(alone(0.0), course_deg=course_deg, speed=speed, up_m=0.0)
    assert met < 1.5
    kept, said = nearest_m(alone(100.0), course_deg=course_deg, speed=speed, up_m=0.0)
    assert kept >= 95.0
    assert "keeping clear of aircraft 4B1900" in said


def test_an_aircraft_that_passes_150_m_above_is_not_in_the_way():
    met, said = nearest_m(alone(100.0), course_deg=225.0, speed=40.0, up_m=150.0)
    assert met < 1.5
    assert "aircraft" not in said
