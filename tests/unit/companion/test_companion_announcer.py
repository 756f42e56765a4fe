"""What is sent to ground stations, and what is left out, when there is much to say."""

import pytest

from vfguide.companion.announcer import MOST_WAITING, Announcer
from vfguide.companion.supervisor import Control, Mode


def said(announcer: Announcer, from_s: float, to_s: float) -> list[str]:
    """Texts that are sent in a time, looked at twice a second; each is short enough for one message."""
    times = (from_s + 0.5 * number for number in range(int(2.0 * (to_s - from_s))))
    return [str(message.text) for now in times for message in announcer.due(now)]


def test_the_first_of_many_warnings_is_not_lost() -> None:
    announcer = Announcer("f1")
    warnings = [f"warning {number}" for number in range(12)]
    for warning in warnings:
        announcer.warn(warning, 0.0)
    assert said(announcer, 0.0, 24.0) == [f"vfguide f1: {warning}" for warning in warnings]


def test_there_are_two_seconds_between_any_two_texts() -> None:
    announcer = Announcer("f1")
    for number in range(3):
        announcer.warn(f"warning {number}", 0.0)
    times = [0.1 * step for step in range(100) if announcer.due(0.1 * step)]
    assert times == pytest.approx([0.0, 2.0, 4.0], abs=0.11)


def test_a_change_of_mode_waits_for_no_warning_and_for_the_change_before_it() -> None:
    announcer = Announcer("f1")
    for number in range(5):
        announcer.warn(f"warning {number}", 0.0)
    said(announcer, 0.0, 0.5)
    announcer.change("leader lost")
    assert said(announcer, 0.5, 1.0) == ["vfguide f1: leader lost"]
    announcer.change("leader is back")
    assert not said(announcer, 1.0, 2.5)
    assert said(announcer, 2.5, 3.0) == ["vfguide f1: leader is back"]


def test_what_is_worse_is_said_first_and_each_with_its_severity() -> None:
    announcer = Announcer("f1")
    announcer.inform("all have agreed", 0.0)
    announcer.change("in its place")
    announcer.warn("too near", 0.0)
    announcer.warn("much too near", 0.0)
    sent = [message for now in (0.0, 2.0, 4.0, 6.0) for message in announcer.due(now)]
    assert [(message.severity, message.text) for message in sent] == [
        (5, "vfguide f1: in its place"),
        (4, "vfguide f1: too near"),
        (4, "vfguide f1: much too near"),
        (6, "vfguide f1: all have agreed"),
    ]


def test_a_warning_finds_room_among_many_words_that_are_none_and_those_may_come_again() -> None:
    announcer = Announcer("f1")
    for number in range(MOST_WAITING):
        announcer.inform(f"word {number}", 0.0)
    announcer.warn("too near", 0.0)
    texts = said(announcer, 0.0, 40.0)
    assert texts[0] == "vfguide f1: too near"
    assert texts[1:] == [f"vfguide f1: word {number}" for number in range(MOST_WAITING - 1)]
    announcer.inform(f"word {MOST_WAITING - 1}", 40.0)
    assert said(announcer, 40.0, 41.0) == [f"vfguide f1: word {MOST_WAITING - 1}"]


def test_a_warning_for_which_there_is_no_room_is_sent_when_it_comes_again() -> None:
    announcer = Announcer("f1")
    for number in range(MOST_WAITING):
        announcer.warn(f"warning {number}", 0.0)
    announcer.warn("the last straw", 0.0)
    assert "vfguide f1: the last straw" not in said(announcer, 0.0, 35.0)
    announcer.warn("the last straw", 35.0)
    assert said(announcer, 35.0, 36.0) == ["vfguide f1: the last straw"]


def test_why_nothing_is_steered_is_told_once_it_has_lasted_for_two_seconds() -> None:
    announcer = Announcer("f1")
    for tenths in range(40):
        announcer.watch(Mode.WAITING, Control.GUIDED, lambda: "nothing to steer by", 0.1 * tenths)
        sent = [message.text for message in announcer.due(0.1 * tenths)]
        assert sent == (["vfguide f1: nothing to steer by"] if tenths == 20 else []), tenths


def test_on_the_way_into_steering_only_the_steering_is_told() -> None:
    announcer = Announcer("f1")
    announcer.watch(Mode.WAITING, Control.GUIDED, lambda: "nothing to steer by", 0.0)
    announcer.watch(Mode.JOINING, Control.GUIDED, lambda: "joining", 0.2)
    announcer.watch(Mode.JOINING, Control.GUIDED, lambda: "joining", 9.0)
    assert said(announcer, 9.0, 12.0) == ["vfguide f1: joining"]
