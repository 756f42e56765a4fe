"""Formations that are flown with the orders of their missions, through MAVLink bytes."""

from collections.abc import Sequence

from pymavlink.dialects.v20 import ardupilotmega as mavlink

import sitl_stub
from vfguide.companion.core import Companion
from vfguide.companion.mission_plan import adapter_of, flight_plan
from vfguide.elementwise import FloatArray
from vfguide.lab.rehearsal.aircraft import Aircraft, step_all
from vfguide.lab.rehearsal.recorder import flight_record
from vfguide.lab.report.geometry import pair_separations, seen_from_leader
from vfguide.link.memory import Mail
from vfguide.mission import Mission
from vfguide.record.flight import FlightRecord

SET_MODE, LOITER, GUIDED = 176, 12, 15


class Flown:
    """A formation that is flown with the orders of its mission, and what may happen to it meanwhile."""

    def __init__(self, mission: Mission) -> None:
        self.mission = mission
        self.names = [mission.leader.vehicle, *mission.followers_by_name]
        self.aircraft = {name: Aircraft(mission, name) for name in self.names}
        self.times: list[float] = []
        self._mail = list[Mail]()

    def until(self, end_s: float) -> None:
        """Fly on."""
        rate_hz = self.mission.rehearsal.rate_hz
        while len(self.times) <= round(end_s * rate_hz):
            now = len(self.times) / rate_hz
            self._mail = step_all(list(self.aircraft.values()), now, self._mail)
            self.times.append(now)

    def restart(self, name: str) -> None:
        """Its companion dies, and another one begins that knows nothing of the flight."""
        plan = flight_plan(self.mission, name)
        adapter = adapter_of(self.mission.vehicles[name])
        self.aircraft[name].companion = Companion(plan, adapter, engage=True)

    def numbers(self) -> list[int]:
        """Of the order that each flies."""
        found = [one.companion.arrangement for one in self.aircraft.values()]
        return [0 if one is None else one.number for one in found]

    def words(self, name: str) -> str:
        """All that its companion has said."""
        return "\n".join(event.text for event in self.aircraft[name].events)

    def record(self) -> FlightRecord:
        """What was flown."""
        records = [one.recorder.record() for one in self.aircraft.values()]
        return flight_record(self.mission, self.times, records, wall_s=0.0)


def nearest(record: FlightRecord, from_s: float) -> float:
    """Least distance of any two from a time on, m."""
    later = record.time_s >= from_s
    return min(float(pair.distance_m[later].min()) for pair in pair_separations(record))


def places(record: FlightRecord) -> dict[str, tuple[float, float]]:
    """(forward, right) of each follower at the end, m."""
    found = {}
    for follower in record.followers:
        forward, right = seen_from_leader(record.leader, follower)
        found[follower.name] = float(forward[-1]), float(right[-1])
    return found


def height(record: FlightRecord, name: str) -> FloatArray:
    """Of a follower above the leader over time, m."""
    follower = next(one for one in record.followers if one.name == name)
    return follower.altitude_amsl_m - record.leader.altitude_amsl_m


def select(autopilot: sitl_stub.Autopilot, mode: int, *, system: int) -> Sequence[object]:
    """Select a mode of a MAVLink system as a pilot's ground station does."""
    selected = mavlink.MAVLink_command_long_message(system, 1, SET_MODE, 0, 1, mode, 0, 0, 0, 0, 0)
    station = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
    return mavlink.MAVLink(None).parse_buffer(autopilot.receive(selected.pack(station))) or []


def leaders(flight: Flown) -> list[str]:
    """Who leads, as each says of itself."""
    return [name for name, one in flight.aircraft.items() if one.companion.snapshot.lead]
