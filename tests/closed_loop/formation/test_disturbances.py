"""A bad link, a pilot, a silent autopilot and rubbish on the link, measured on the emulators' true states."""

from collections import Counter
from collections.abc import Callable
from random import Random

import numpy as np
import pytest
from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.kit.formation import GUIDED, LOITER, Formation
from tests.kit.missions import content_of, on_the_circle
from vfguide.link.codec import decode, encode
from vfguide.link.memory import Mail
from vfguide.mission import Mission

SETTLED_S = 12.0
"""From here on everyone who started like that has settled."""

RECOVERY_S = 30.0
"""From the end of a disturbance until everyone is within 1 m of the slot, and stays."""


def launched(rate_hz: float = 10.0, **options: object) -> Formation:
    """Launch the formation of the article's circle in wind, everyone in place."""
    return Formation(on_the_circle(rate_hz=rate_hz), **options)


def test_formation_is_kept_over_a_bad_link():
    formation = launched()
    formation.fly(SETTLED_S)
    formation.link(delay_s=0.3, loss=0.3)
    formation.fly(SETTLED_S + 50.0)
    formation.link(delay_s=0.0, loss=0.0)
    flown = formation.fly(SETTLED_S + 50.0 + RECOVERY_S)
    assert flown.errors(SETTLED_S).max() < 1.0
    assert flown.nearest() >= 5.0


ARDUPLANE = {"LOITER": (LOITER,), "GUIDED": (GUIDED,)}
PX4 = {"AUTO.LOITER": (4, 3), "AUTO.COURSE": (4, 19)}
"""What a pilot selects: the autopilot's own loiter, and what a companion steers by."""


@pytest.mark.parametrize(
    ("name", "length_s", "modes"),
    [("f1", 5.0, ARDUPLANE), ("f2", 10.0, ARDUPLANE), ("f3", 5.0, ARDUPLANE), ("f1", 5.0, PX4)],
)
def test_a_follower_that_its_pilot_borrows_comes_back(name, length_s, modes):
    returned_s = SETTLED_S + length_s
    (loiter, by_pilot), (guided, by_companion) = modes.items()
    content = content_of(on_the_circle(rate_hz=10.0))
    content["vehicles"][name]["autopilot"] = "px4" if modes is PX4 else "ardupilot"
    formation = Formation(Mission.model_validate(content))
    formation.fly(SETTLED_S)
    borrowed = formation.emulators[name]
    assert borrowed.truth().mode == guided
    assert borrowed.select(*by_pilot) == [mavlink.MAV_RESULT_ACCEPTED]
    before = borrowed.setpoints
    formation.fly(returned_s)
    # Nobody but the pilot has touched the mode in the meantime.
    assert borrowed.setpoints == before > 0
    assert borrowed.truth().mode == loiter
    assert borrowed.select(*by_companion) == [mavlink.MAV_RESULT_ACCEPTED]
    flown = formation.fly(returned_s + RECOVERY_S + 10.0)
    assert borrowed.setpoints > before
    assert borrowed.truth().mode == guided
    assert flown.errors(SETTLED_S, returned_s).max() > 10.0
    assert flown.errors(returned_s + RECOVERY_S).max() < 1.0
    assert flown.nearest() >= 5.0


@pytest.mark.parametrize("name", ["f1", "f2", "f3"])
def test_a_follower_whose_companion_was_dead_comes_back_clear_of_the_others(name):
    # The autopilot holds the last course that it was given: on a circle that leads through the others' slots.
    restarted_s = SETTLED_S + 4.0
    formation = launched()
    formation.fly(SETTLED_S)
    formation.kill(name)
    before = formation.emulators[name].setpoints
    formation.fly(restarted_s)
    assert formation.emulators[name].setpoints == before > 0
    formation.restart(name)
    flown = formation.fly(restarted_s + RECOVERY_S + 10.0)
    assert flown.errors(SETTLED_S, restarted_s + 5.0).max() > 10.0
    assert flown.errors(restarted_s + RECOVERY_S).max() < 1.0
    assert flown.nearest() >= 5.0


def test_two_that_come_back_at_once_keep_clear_of_a_third_whose_companion_is_dead():
    formation = launched()
    formation.fly(SETTLED_S)
    for name in ("f1", "f3"):
        formation.emulators[name].select(LOITER)
    formation.fly(SETTLED_S + 5.0)
    formation.kill("f2")
    formation.fly(SETTLED_S + 8.0)
    for name in ("f1", "f3"):
        formation.emulators[name].select(GUIDED)
    formation.fly(SETTLED_S + 12.0)
    formation.restart("f2")
    # Those who went round have more than 100 m to make up, at 8 m/s.
    flown = formation.fly(SETTLED_S + 12.0 + RECOVERY_S + 20.0)
    assert flown.errors(SETTLED_S, SETTLED_S + 20.0).max() > 100.0
    assert flown.errors(SETTLED_S + 12.0 + RECOVERY_S + 10.0).max() < 1.0
    assert flown.nearest() >= 5.0


def test_formation_outlives_a_leader_without_telemetry():
    formation = launched()
    formation.fly(SETTLED_S)
    leader = formation.emulators["leader"]
    leader.silent, before = True, leader.setpoints
    formation.fly(SETTLED_S + 3.0)
    assert leader.setpoints == before > 0
    leader.silent = False
    flown = formation.fly(SETTLED_S + 3.0 + RECOVERY_S + 10.0)
    assert "predicting" in flown.modes("f1")
    assert flown.errors(SETTLED_S + 3.0 + RECOVERY_S).max() < 1.0
    assert flown.nearest() >= 5.0


def rubbish(random: Random, published: list[Mail]) -> list[Mail]:
    """Follow each of the leader's states by what must not be mistaken for one."""
    heard: list[Mail] = []
    for sender, data in published:
        if sender != "leader":
            heard.append((sender, data))
            continue
        state = decode(data)
        place = random.randrange(len(data))
        damaged = data[:place] + bytes([data[place] ^ 1 << random.randrange(8)]) + data[place + 1 :]
        made = [
            data,
            data,
            random.randbytes(random.randrange(200)),
            random.randbytes(len(data)),
            data[: random.randrange(len(data))],
            damaged,
            encode(replace(state, time_s=state.time_s + 10.0, course=state.course + 1.0)),
            encode(replace(state, time_s=state.time_s - 1e4)),
            encode(replace(state, time_s=np.inf)),
            encode(replace(state, ground_speed=np.nan)),
        ]
        heard += [(sender, one) for one in made]
    return heard


def test_rubbish_on_the_link_changes_nothing_but_counters(tmp_path):
    random = Random(7)

    def flown(carry: Callable[[list[Mail]], list[Mail]]) -> tuple[dict[str, bytes], Counter[str]]:
        formation = launched(20.0, logged=True, carry=carry)
        formation.fly(20.0)
        content, counters = {}, Counter[str]()
        for name, aircraft in formation.aircraft.items():
            aircraft.log.write(tmp_path / "log.tlog")
            content[name] = (tmp_path / "log.tlog").read_bytes()
            counters += aircraft.companion.counters
        return content, counters

    clean, nothing = flown(list)
    disturbed, counters = flown(lambda published: rubbish(random, published))
    assert disturbed == clean
    assert all(len(content) > 50_000 for content in clean.values())
    counted = counters - nothing
    reasons = {"from the future", "not newer", "too old"}
    assert set(counted) == {"malformed", *reasons}
    # Three followers, 400 states.
    assert counted["malformed"] >= 6 * 3 * 390
    assert all(counted[reason] >= 3 * 390 for reason in reasons)
