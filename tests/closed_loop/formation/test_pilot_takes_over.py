"""A pilot who takes a follower out of the formation and puts it back, at an autopilot that wants a stream."""

from collections.abc import Callable

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

import sitl_stub
import vfguide.lab.rehearsal.aircraft
from vfguide.lab.rehearsal.aircraft import Aircraft, Mail, step_all
from vfguide.lab.rehearsal.emulators import emulator_of
from vfguide.lab.rehearsal.recorder import flight_record
from vfguide.lab.report.geometry import slot_error
from vfguide.mission import Mission

MissionWith = Callable[..., Mission]

SET_MODE = 176
LOITER, GUIDED_COURSE = (4, 3), (4, 19)
TAKEN_S, RETURNED_S, END_S = 65.0, 75.0, 130.0


@pytest.fixture
def emulators(monkeypatch: pytest.MonkeyPatch) -> dict[str, sitl_stub.Autopilot]:
    """The emulated autopilots of the aircraft that are made, by name."""
    made: dict[str, sitl_stub.Autopilot] = {}

    def note(mission: Mission, name: str) -> sitl_stub.Autopilot:
        return made.setdefault(name, emulator_of(mission, name))

    monkeypatch.setattr(vfguide.lab.rehearsal.aircraft, "emulator_of", note)
    return made


def results_of_selecting(autopilot: sitl_stub.Autopilot, mode: tuple[int, int]) -> list[int]:
    """What the autopilot answers a ground station that selects a mode."""
    selected = mavlink.MAVLink_command_long_message(2, 1, SET_MODE, 0, 1, *mode, 0, 0, 0, 0)
    station = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
    replies = autopilot.receive(selected.pack(station))
    answers = mavlink.MAVLink(None).parse_buffer(replies) or []
    return [one.result for one in answers if one.get_type() == "COMMAND_ACK"]


def test_a_follower_that_its_pilot_took_and_gave_back_joins_again(
    mission_with: MissionWith, emulators: dict[str, sitl_stub.Autopilot]
) -> None:
    mission = mission_with("line-calm", vehicles={"f1": {"system_id": 2, "autopilot": "px4"}})
    names = [mission.leader.vehicle, *mission.followers_by_name]
    formation = [Aircraft(mission, name) for name in names]
    rate_hz = mission.rehearsal.rate_hz
    times = [step / rate_hz for step in range(round(END_S * rate_hz) + 1)]
    flown, answers = emulators["f1"], []
    mail: list[Mail] = []
    for now in times:
        if now == TAKEN_S:
            assert flown.truth().mode == "AUTO.COURSE"
            answers += results_of_selecting(flown, LOITER)
        if now == RETURNED_S:
            # Nobody but the pilot has touched the mode in the meantime.
            assert flown.truth().mode == "AUTO.LOITER"
            answers += results_of_selecting(flown, GUIDED_COURSE)
        mail = step_all(formation, now, mail)
    assert answers == [mavlink.MAV_RESULT_ACCEPTED] * 2
    assert flown.truth().mode == "AUTO.COURSE"
    records = [aircraft.recorder.record() for aircraft in formation]
    record = flight_record(mission, times, records, wall_s=0.0)
    error = slot_error(record.leader, record.followers[0]).distance_m
    assert error[round(TAKEN_S * rate_hz)] < 1.0
    assert error[round(RETURNED_S * rate_hz)] > 100.0
    assert error[-round(5.0 * rate_hz) :].max() < 1.0
