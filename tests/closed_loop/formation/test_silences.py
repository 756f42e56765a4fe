"""A leader that falls silent, for a while and for good, measured on the emulators' true states."""

import pytest

from tests.kit.flight import fly
from tests.kit.formation import Formation
from tests.kit.missions import mission_with, on_the_circle, replaced
from vfguide.companion.traffic import FORGET_S
from vfguide.link.memory import Mail

MAKES_WAY_M = 8.0
"""How far a follower leaves its slot to keep clear of where a leader without a companion would fly by now,
and of where it was last heard."""

BACK_S = 5.0 + FORGET_S + 2.0
"""After `SETTLED_S`: a leader that is silent from 5 s on is not looked for any more, and all are back."""

SETTLED_S = 15.0
"""From here on every follower is in its slot: they start there."""


class Silence(Formation):
    """A formation, everybody in the slot, whose followers hear their leader but for some time."""

    def __init__(self, name: str, begins_s: float, ends_s: float = 1e9, **sections: object) -> None:
        start: dict[str, object] = {"f1": {}, "f2": {}, "f3": {}}
        mission = mission_with(name, rehearsal={"start": start, "rate_hz": 10.0}, **sections)
        super().__init__(mission, carry=self.heard)
        self.begins_s, self.ends_s = begins_s, ends_s

    def heard(self, published: list[Mail]) -> list[Mail]:
        if not self.begins_s < self.now < self.ends_s:
            return published
        return [one for one in published if one[0] != "leader"]


@pytest.mark.parametrize("length_s", [5.0, 20.0])
@pytest.mark.parametrize("name", ["line-wind", "circle-wind"])
def test_formation_is_kept_while_the_leader_is_silent(name, length_s):
    ends_s = SETTLED_S + 5.0 + length_s
    flown = Silence(name, SETTLED_S + 5.0, ends_s).fly(ends_s + 15.0)
    record = flown.record
    modes = [record.mode_names[number] for number in record.followers[0].mode]
    assert modes[int((ends_s - 0.5) * record.rate_hz)] == "predicting"
    assert modes[-1] == "tracking"
    assert flown.errors(SETTLED_S).max() < MAKES_WAY_M
    assert flown.errors(SETTLED_S + min(BACK_S, 5.0 + length_s + 10.0)).max() < 1.0
    assert flown.nearest() >= 5.0


@pytest.mark.parametrize("name", ["line-wind", "circle-wind"])
def test_a_formation_whose_leader_is_lost_for_good_comes_apart(name):
    patience = {"prediction_s": 5.0, "breakaway_s": 12.0}
    silence = Silence(name, SETTLED_S, patience=patience)
    lost_s = SETTLED_S + 5.0 + 12.0
    for until_s, mode in (
        (lost_s - 0.5, "GUIDED"),
        (lost_s + 2.0, "LOITER"),
        (lost_s + 32.0, "LOITER"),
    ):
        flown = silence.fly(until_s)
        modes = silence.flight_modes()
        assert {modes[name] for name in ("f1", "f2", "f3")} == {mode}
    for follower in ("f1", "f2", "f3"):
        assert "tracking" in flown.modes(follower)[:-3]
        assert flown.modes(follower)[-3:] == ["predicting", "breakaway", "lost"]
    assert flown.nearest(among={"f1", "f2", "f3"}) >= 5.0


def test_one_that_loses_the_link_for_good_breaks_away_and_the_others_fly_on():
    lost_s, prediction_s = 15.0, 10.0
    loss = {"vehicle": "f1", "at_s": lost_s, "what": "link"}
    mission = on_the_circle(rate_hz=10.0, duration_s=60.0, losses=[loss])
    flown = fly(replaced(mission, patience={"prediction_s": prediction_s}))
    assert flown.modes("f1")[-3:] == ["predicting", "breakaway", "lost"]
    # In the article's wind, by what it heard last.
    assert flown.errors(lost_s, lost_s + prediction_s - 1.0)[0].max() < 5.0
    assert flown.errors(lost_s + prediction_s + 15.0)[0].min() > 30.0
    assert flown.errors(57.0)[1:].max() < 1.0
    assert flown.nearest() >= 5.0
