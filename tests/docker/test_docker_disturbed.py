"""What containers do to a formation that die, hang, are cut off or lie; times are those of the flight."""

import secrets
import time
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from msgspec.structs import replace

from tests.docker.flown import Flown
from tests.docker.formation import Formation
from tests.kit.missions import content_of, on_the_circle
from vfguide.link.codec import decode, decode_envelope, encode

IN_SLOT_M = 1.0

APART_M = 5.0
"""Least separation where nobody has strayed."""

REJOINING_APART_M = 5.0
"""Least separation while somebody who has strayed comes back."""

DEAF_M = 5.0
"""How far a follower may be off that has not heard its leader for ten seconds, in the article's wind."""

CUT_GIVE_WAY_M = 40.0
"""How far others may leave their slots for one that is silent. In the article's wind, which swings, one that
holds its heading comes elsewhere than one that holds its course, and they keep clear of both: 17 and 26 m."""

LOST_GIVE_WAY_M = 120.0
"""The same where one is lost for good: f2 flies where it would be had its autopilot held its last course, and
makes way for that by 80 m as seen."""

GIVE_WAY_M = 4.0
"""The same for one that hangs and comes back to its slot."""

LINK = ("--cafile", "/var/lib/vfguide/trust/ca.pem", "-h", "broker", "-p", "8883")
LIE = "/dev/shm/lie"  # noqa: S108
STATE = "vfguide/circle-wind/leader/state"

SETTLED_S = 14.0
"""Companions take over some seconds after the start."""

FORGED_S = (12.0, 20.0)
CUT_S = (22.0, 32.0)
RESTARTED_S = 44.0
PAUSED_S = (60.0, 65.0)
KILLED_S = 100.0
ENDS_S = 160.0
"""Where a leader was away for 9 s its rear follower gave way to the others and had 185 m to make up."""

IMPAIRED_S = (20.0, 40.0)
LOST_S = 55.0
PREDICTION_S = 10.0
LOST_ENDS_S = 95.0

PATIENCE_S = 25.0
"""Real time for the companions that are let in to start, where one is not and cannot be waited for."""


def client(formation: Formation, user: str, program: str, *options: str, check: bool = True) -> str:
    """Run a program of mosquitto's, with the rights of the container whose user it is."""
    command = 'exec "$0" -u "$VEHICLE" -P "$(cat /var/lib/vfguide/password/password)" "$@"'
    return str(formation.inside(user, "sh", "-c", command, program, *LINK, *options, check=check))


def forge(formation: Formation) -> dict[str, Any]:
    """As f3, tell the formation something of one's own; then, that the leader is a kilometre away."""
    heard = client(
        formation, "judge", "mosquitto_sub", "-t", STATE, "-C", "1", "-W", "15", "-F", "%x"
    )
    true = decode(decode_envelope(bytes.fromhex(heard.strip())).body)
    sequence = (true.sequence + 1000) % 2**32
    lie = encode(replace(true, latitude_deg=true.latitude_deg + 0.01, sequence=sequence))
    mark = secrets.token_hex(8)
    formation.reach(FORGED_S[0] - 1.0)
    with ThreadPoolExecutor() as pool:
        listening = pool.submit(
            client, formation, "judge", "mosquitto_sub", "-t", "vfguide/#", "-W", "9", "-F", "%t %x",
            check=False,
        )  # fmt: skip
        formation.reach(FORGED_S[0])
        often = ("--repeat", "50", "--repeat-delay", "0.1")
        # The container's shell makes bytes of it: no option of a program can hold a zero.
        octal = "".join(f"\\{byte:03o}" for byte in lie)
        formation.inside("f3", "sh", "-c", f"printf '{octal}' > {LIE}")
        client(formation, "f3", "mosquitto_pub", "-t", "vfguide/circle-wind/f3/reply", "-m", mark)
        client(formation, "f3", "mosquitto_pub", "-t", STATE, "-f", LIE, *often)
        lines = listening.result().split("\n")
    return {
        "lies heard": sum(lie.hex() in line for line in lines),
        "own words heard": sum(mark.encode().hex() in line for line in lines),
        "states heard": sum(STATE in line for line in lines),
    }


def troubled(formation: Formation) -> Flown:
    """One trouble after the other, with time to recover in between."""
    formation.start()
    seen = {"forged": forge(formation)}
    formation.reach(CUT_S[0])
    formation.cut_off("f2")
    formation.reach(CUT_S[1])
    formation.let_back("f2")
    formation.reach(RESTARTED_S)
    formation.compose("restart", "--timeout", "1", "broker")
    formation.reach(PAUSED_S[0])
    formation.compose("pause", "f1")
    formation.reach(PAUSED_S[1])
    formation.compose("unpause", "f1")
    formation.reach(KILLED_S)
    # From within: what an operator kills through Docker is not started again.
    formation.inside("leader", "sh", "-c", "kill -KILL $(cat /proc/1/task/1/children)", check=False)
    time.sleep(5.0)
    seen["restarts"] = formation.inspect("leader")["RestartCount"]
    return formation.finish(seen)


def abandoned(formation: Formation) -> Flown:
    """One companion that is not let in, a bad link for all, and one that loses it for good."""
    formation.overrule({"services": {"f3": {"environment": {"VFGUIDE_LINK_PASSWORD": "wrong"}}}})
    formation.start()
    formation.reach(IMPAIRED_S[0])
    seconds = IMPAIRED_S[1] - IMPAIRED_S[0]
    impaired = formation.impair("broker", seconds=seconds, delay_s=0.2, loss=0.2)
    formation.reach(LOST_S)
    # On the outside of the turn: where it would be if its companion had died, nobody is.
    formation.cut_off("f1")
    return formation.finish({"impaired": impaired})


def docker_flights() -> dict[str, Any]:
    """What is to be flown for the tests of this module."""
    mission = content_of(on_the_circle(), "json")
    impatient = {**mission, "patience": {"prediction_s": PREDICTION_S}}
    return {
        "troubled": (troubled, {"mission": mission, "DURATION": str(ENDS_S)}),
        "abandoned": (
            abandoned,
            {"mission": impatient, "DURATION": str(LOST_ENDS_S), "PATIENCE": str(PATIENCE_S)},
        ),
    }


def test_who_publishes_as_the_leader_is_heard_by_nobody(flights):
    flown = flights["troubled"]
    assert flown.seen["forged"]["lies heard"] == 0
    assert flown.seen["forged"]["own words heard"] >= 1
    assert flown.seen["forged"]["states heard"] >= 20
    assert flown.greatest(SETTLED_S, CUT_S[0], "f1", "f2", "f3") < IN_SLOT_M


def test_a_follower_that_is_cut_off_for_ten_seconds_stays_near_its_slot(flights, tell):
    flown = flights["troubled"]
    off_m = flown.greatest(*CUT_S, "f2")
    others_m = flown.greatest(CUT_S[0], RESTARTED_S, "f1", "f3")
    tell(f"cut off for 10 s: at most {off_m:.2f} m off, the others {others_m:.2f} m")
    assert "predicting" in flown.modes("f2")
    assert off_m < DEAF_M
    assert others_m < CUT_GIVE_WAY_M
    assert flown.greatest(RESTARTED_S - 3.0, RESTARTED_S, "f1", "f2", "f3") < IN_SLOT_M


def test_a_formation_flies_on_while_its_broker_starts_again(flights, tell):
    flown = flights["troubled"]
    off_m = flown.greatest(RESTARTED_S, PAUSED_S[0], "f1", "f2", "f3")
    tell(f"broker started again: at most {off_m:.2f} m off")
    assert off_m < 2.0
    assert flown.greatest(PAUSED_S[0] - 3.0, PAUSED_S[0], "f1", "f2", "f3") < IN_SLOT_M


def test_a_follower_whose_companion_hangs_for_five_seconds_comes_back(flights, tell):
    flown = flights["troubled"]
    off_m = flown.greatest(PAUSED_S[0], KILLED_S, "f1")
    others_m = flown.greatest(PAUSED_S[0], KILLED_S, "f2", "f3")
    tell(f"paused for 5 s: at most {off_m:.1f} m off, the others {others_m:.2f} m")
    assert others_m < GIVE_WAY_M
    assert flown.greatest(KILLED_S - 3.0, KILLED_S, "f1", "f2", "f3") < IN_SLOT_M


def test_a_leader_whose_companion_is_killed_is_led_again_and_followed(flights, tell):
    flown = flights["troubled"]
    off_m = flown.greatest(KILLED_S, ENDS_S, "f1", "f2", "f3")
    tell(f"leader's companion killed: at most {off_m:.1f} m off")
    assert flown.seen["restarts"] == 1
    assert flown.logs["leader"].count("waiting -> ") >= 2
    assert flown.greatest(ENDS_S - 3.0, ENDS_S, "f1", "f2", "f3") < IN_SLOT_M


def test_aircraft_stay_apart_through_all_troubles(flights, tell):
    least_m = flights["troubled"].least_separation_m("leader", "f1", "f2", "f3")
    tell(f"least separation through all troubles: {least_m:.1f} m")
    assert least_m > REJOINING_APART_M


def test_a_companion_with_the_wrong_password_is_told_so_and_joins_nobody(flights):
    flown = flights["abandoned"]
    assert "refused: wrong user name or password" in flown.logs["f3"]
    assert "begun without the companions of f3" in flown.logs["judge"]
    assert float(flown.errors("f3", SETTLED_S, LOST_ENDS_S).min()) > 30.0
    assert flown.status == 1


def test_two_followers_hold_their_slots_while_the_third_is_not_let_in(flights):
    flown = flights["abandoned"]
    assert flown.greatest(SETTLED_S, IMPAIRED_S[0], "f1", "f2") < IN_SLOT_M


def test_a_slow_and_lossy_link_costs_little(flights, tell):
    flown = flights["abandoned"]
    errors = [flown.errors(name, *IMPAIRED_S) for name in ("f1", "f2")]
    mean_m = sum(float(one.mean()) for one in errors) / len(errors)
    off_m = max(float(one.max()) for one in errors)
    tell(
        f"200 ms and 20 % loss: mean {mean_m:.2f} m, at most {off_m:.2f} m off; {flown.seen['impaired']}"
    )
    assert mean_m < 1.0
    assert off_m < 5.0
    assert flown.greatest(LOST_S - 3.0, LOST_S, "f1", "f2") < IN_SLOT_M


def test_a_follower_that_loses_the_link_for_good_breaks_away(flights, tell):
    flown = flights["abandoned"]
    assert flown.modes("f1")[-1] != "tracking"
    off_m = flown.greatest(LOST_S, LOST_S + PREDICTION_S - 1.0, "f1")
    tell(f"without the link: at most {off_m:.2f} m off for {PREDICTION_S - 1.0:.0f} s")
    assert off_m < DEAF_M
    assert float(flown.errors("f1", LOST_S + PREDICTION_S + 15.0, LOST_ENDS_S).min()) > 30.0
    assert flown.least_separation_m("leader", "f1", "f2") > APART_M


def test_the_others_fly_on_without_a_follower_that_broke_away(flights, tell):
    flown = flights["abandoned"]
    off_m = flown.greatest(LOST_S, LOST_ENDS_S, "f2")
    tell(f"a follower lost for good: another gave way by {off_m:.1f} m")
    assert off_m < LOST_GIVE_WAY_M
    assert flown.greatest(LOST_ENDS_S - 3.0, LOST_ENDS_S, "f2") < IN_SLOT_M
