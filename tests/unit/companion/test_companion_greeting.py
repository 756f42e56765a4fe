"""Where it takes long to be heard, a companion waits for the others before it joins them."""

import pytest

from tests.kit.companion import companion_of, new_flight

GREETING_S = 8.0


def greeting(*, heard_s: dict[str, float]) -> float:
    """When f1 is steered first, s, if each of the others is heard from a time on."""
    one = new_flight()
    one.companion = companion_of(greeting_s=GREETING_S)
    for tenth in range(200):
        now = 0.1 * tenth
        one.run(now)
        if one.modes and one.modes[-1][1].steers:
            break
        for name, from_s in heard_s.items():
            if now >= from_s:
                one.companion.receive_neighbour(name, next(iter(one.link(now))), now)
    return one.now


@pytest.mark.parametrize(
    ("heard_s", "joins_s"),
    [
        ({"f2": 0.0, "f3": 0.0}, 1.0),
        # It waits for one that is heard late, and joins without one that is never heard.
        ({"f2": 0.0, "f3": 5.0}, 6.0),
        ({"f2": 0.0}, GREETING_S + 1.0),
    ],
)
def test_it_waits_for_who_is_not_heard_yet_and_not_for_ever(heard_s, joins_s):
    """Heartbeats, to which modes are commanded, come once a second."""
    assert greeting(heard_s=heard_s) == pytest.approx(joins_s, abs=1.1)
