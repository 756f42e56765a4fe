import json
import sys
from collections.abc import Callable
from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import asdict

import sitl_stub
from tests.kit.missions import shipped
from vfguide.commands.judge import until_online
from vfguide.errors import InputError, VfguideError
from vfguide.lab.rehearsal.live import LiveFlight, await_start, give_start
from vfguide.lab.rehearsal.processes import Process
from vfguide.lab.rehearsal.recorder import TruthCollector, decode_truth

MISSION = shipped("circle-wind")

NOWHERE = ("127.0.0.1", 1)


def truth(time_s: float) -> sitl_stub.Truth:
    numbers = dict.fromkeys(sitl_stub.Truth.__struct_fields__, 1.0)
    return sitl_stub.Truth(**numbers | {"time_s": time_s, "mode": "GUIDED", "armed": True})


def datagram(system_id: int, time_s: float) -> bytes:
    return json.dumps({"system_id": system_id, **asdict(truth(time_s))}).encode()


@given(st.binary())
def test_a_true_state_is_read_as_it_was_written_and_other_bytes_are_none(data):
    assert decode_truth(data) is None
    assert decode_truth(datagram(3, 0.05)) == (3, truth(0.05))


@given(
    st.recursive(
        st.none() | st.booleans() | st.floats() | st.integers() | st.text(),
        lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    ),
    st.sampled_from(["system_id", *sitl_stub.Truth.__struct_fields__]),
)
def test_a_field_of_any_kind_never_breaks_the_judge(value, name):
    content = json.loads(datagram(1, 0.0))
    content[name] = value
    judge = TruthCollector(MISSION)
    judge.datagram_received(json.dumps(content).encode(), NOWHERE)
    assert judge.time_s == -1.0


def test_a_judge_knows_the_time_that_all_vehicles_have_reached():
    judge = TruthCollector(MISSION)
    for system_id in (1, 2, 3, 4):
        judge.datagram_received(datagram(system_id, 0.05), NOWHERE)
    judge.datagram_received(datagram(1, 0.1), NOWHERE)
    judge.datagram_received(datagram(9, 0.1), NOWHERE)
    assert judge.time_s == pytest.approx(0.05)
    assert judge.last_seen_s() == pytest.approx({"leader": 0.1, "f1": 0.05, "f2": 0.05, "f3": 0.05})


def test_a_record_holds_the_samples_that_are_known_of_everybody():
    judge = TruthCollector(MISSION)
    with pytest.raises(VfguideError, match="nothing was seen"):
        judge.record(wall_s=1.0)
    for system_id, time_s in product((1, 2, 3, 4), (0.0, 0.05, 0.1)):
        if (system_id, time_s) != (2, 0.05):
            judge.datagram_received(datagram(system_id, time_s), NOWHERE)
    record = judge.record(wall_s=1.0)
    assert list(record.time_s) == [0.0, 0.1]
    assert [vehicle.name for vehicle in record.vehicles] == ["leader", "f1", "f2", "f3"]


async def test_a_companion_that_crashes_ends_the_flight_and_one_that_was_killed_does_not(tmp_path):
    flight = LiveFlight(MISSION, directory=tmp_path, links=[], speedup=1.0)
    for ends, found in (("os.abort()", "f1 has ended with status -6"), ("pass", "no emulator")):
        one = Process("f1", [sys.executable, "-c", f"import os; {ends}"], tmp_path / "log")
        flight.companions["f1"] = one
        await one.start()
        await one.wait()
        with pytest.raises(VfguideError, match=found):
            flight.check()
    one = Process("f1", [sys.executable, "-c", "import time; time.sleep(60)"], tmp_path / "log")
    await one.start()
    await one.kill()
    assert (one.running, one.exit_code) == (False, None)
    await flight.stop()


class Time:
    """A clock that only sleepers move on; something may happen at a certain time."""

    def __init__(self, now_s: float, *, at_s: float = 0.0, happens: Callable[[], None]) -> None:
        self.now_s = now_s
        self._at_s = at_s
        self._happens = happens

    def __call__(self) -> float:
        return self.now_s

    def sleep(self, seconds: float) -> None:
        before_s, self.now_s = self.now_s, self.now_s + seconds
        if before_s < self._at_s <= self.now_s:
            self._happens()


@pytest.mark.parametrize("earlier_s", [None, 900.0])
def test_a_signal_that_comes_is_heard_and_one_of_an_earlier_flight_is_not(tmp_path, earlier_s):
    file = tmp_path / "signal"
    if earlier_s is not None:
        give_start(file, epoch_s=earlier_s)
    time = Time(1000.0, at_s=1007.0, happens=lambda: give_start(file, epoch_s=1012.0))
    assert await_start(file, patience_s=60.0, clock=time, sleep=time.sleep) == 1012.0
    assert time.now_s == pytest.approx(1007.0, abs=0.1)


@pytest.mark.parametrize("content", ["", "soon\n", "nan\n", "inf\n", "99"])
def test_who_waits_in_vain_gives_up_and_a_signal_that_cannot_be_given_is_one_line(
    tmp_path, content
):
    file = tmp_path / "signal"
    file.write_text(content)
    time = Time(1000.0, happens=lambda: None)
    with pytest.raises(VfguideError, match="no flight has begun within 60 s"):
        await_start(file, patience_s=60.0, clock=time, sleep=time.sleep)
    words = r"signal: cannot be written \(No such file or directory\)"
    with pytest.raises(InputError, match=words):
        give_start(tmp_path / "nowhere" / "signal", epoch_s=1.0)


class Incomplete:
    """A flight one of whose companions never comes."""

    async def missing(self) -> list[str]:
        return ["f3"]


async def test_a_judge_begins_without_companions_that_do_not_come_and_says_so(capsys):
    await until_online(Incomplete(), patience_s=0.0, stop=lambda: False)  # type: ignore[arg-type]
    assert "begun without the companions of f3" in capsys.readouterr().err
