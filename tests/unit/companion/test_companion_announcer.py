"""What is sent to ground stations, and what is left out, when there is much to say."""

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
    assert said(announcer, 0.0, 20.0) == [f"vfguide f1: {warning}" for warning in warnings]


def test_a_warning_for_which_there_is_no_room_is_sent_when_it_comes_again() -> None:
    announcer = Announcer("f1")
    for number in range(MOST_WAITING):
        announcer.warn(f"warning {number}", 0.0)
    announcer.warn("the last straw", 0.0)
    assert "vfguide f1: the last straw" not in said(announcer, 0.0, 25.0)
    announcer.warn("the last straw", 25.0)
    assert said(announcer, 25.0, 26.0) == ["vfguide f1: the last straw"]


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
