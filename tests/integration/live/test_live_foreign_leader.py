"""Live followers behind an aircraft without a companion, over sockets."""

import json

from tests.kit.programs import vfguide


async def test_followers_keep_their_slots_with_a_delay_that_they_ask_for(mosquitto, speedup):
    flown = await vfguide(
        *("fly", "foreign-leader", "--live", "--json", "--speedup", f"{speedup:g}"),
        *("--duration", 48, "--link", mosquitto().url, "--set", "leader.least_delay_s=null"),
    )
    assert flown.status in (0, 1), flown.err
    summary = json.loads(flown.out)
    # 0.2 s that nobody knows of would be 4 m.
    assert summary["formation"]["mean_error_m"] < 0.6
    assert set(summary["latency"]["vehicles"]) == {"f1", "f2", "f3"}
