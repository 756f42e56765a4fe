from collections.abc import Callable
from pathlib import Path

import pytest

from vfguide.errors import InputError, VfguideError
from vfguide.lab.rehearsal.watched import await_start, give_start


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


def nothing() -> None:
    pass


def test_a_signal_that_comes_is_heard(tmp_path: Path) -> None:
    file = tmp_path / "signal"
    time = Time(1000.0, at_s=1007.0, happens=lambda: give_start(file, epoch_s=1012.0))
    assert await_start(file, patience_s=60.0, clock=time, sleep=time.sleep) == 1012.0
    assert time.now_s == pytest.approx(1007.0, abs=0.1)


def test_a_signal_of_an_earlier_flight_is_not_taken_for_ones_own(tmp_path: Path) -> None:
    file = tmp_path / "signal"
    give_start(file, epoch_s=900.0)
    time = Time(1000.0, at_s=1001.0, happens=lambda: give_start(file, epoch_s=1006.0))
    assert await_start(file, patience_s=60.0, clock=time, sleep=time.sleep) == 1006.0


@pytest.mark.parametrize("content", ["", "soon\n", "nan\n", "inf\n", "99"])
def test_who_waits_in_vain_gives_up(tmp_path: Path, content: str) -> None:
    file = tmp_path / "signal"
    file.write_text(content)
    time = Time(1000.0, happens=nothing)
    with pytest.raises(VfguideError, match="no flight has begun within 60 s"):
        await_start(file, patience_s=60.0, clock=time, sleep=time.sleep)


def test_a_signal_that_cannot_be_given_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(
        InputError, match=r"signal: cannot be written \(No such file or directory\)"
    ):
        give_start(tmp_path / "nowhere" / "signal", epoch_s=1.0)
