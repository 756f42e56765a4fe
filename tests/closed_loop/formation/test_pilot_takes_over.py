"""A pilot who takes a follower out of the formation and puts it back, at an autopilot that wants a stream."""

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.kit.formation import Formation
from tests.kit.missions import mission_with

LOITER, GUIDED_COURSE = (4, 3), (4, 19)
TAKEN_S, RETURNED_S, END_S = 25.0, 35.0, 90.0


def test_a_follower_that_its_pilot_took_and_gave_back_joins_again():
    vehicle = {"system_id": 2, "autopilot": "px4"}
    formation = Formation(
        mission_with("line-calm", vehicles={"f1": vehicle}, rehearsal={"rate_hz": 10.0})
    )
    f1 = formation.emulators["f1"]
    formation.fly(TAKEN_S)
    assert f1.truth().mode == "AUTO.COURSE"
    assert f1.select(*LOITER) == [mavlink.MAV_RESULT_ACCEPTED]
    formation.fly(RETURNED_S)
    # Nobody but the pilot has touched the mode in the meantime.
    assert f1.truth().mode == "AUTO.LOITER"
    assert f1.select(*GUIDED_COURSE) == [mavlink.MAV_RESULT_ACCEPTED]
    flown = formation.fly(END_S)
    assert f1.truth().mode == "AUTO.COURSE"
    error = flown.errors()[0]
    rate_hz = flown.record.rate_hz
    assert error[round(TAKEN_S * rate_hz)] < 1.0
    assert error[round(RETURNED_S * rate_hz)] > 100.0
    assert error[-round(5.0 * rate_hz) :].max() < 1.0
