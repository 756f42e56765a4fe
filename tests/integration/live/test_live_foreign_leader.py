"""Live followers behind an aircraft without a companion, over sockets."""

import asyncio
import json
import sys

PATIENCE_S = 200.0


async def test_followers_keep_their_slots_with_a_delay_that_they_ask_for(
    broker_in, tmp_path, speedup
):
    async with broker_in(tmp_path) as broker:
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "vfguide", "fly", "foreign-leader", "--live", "--json"),
            *("--speedup", f"{speedup:g}", "--duration", "60"),
            *("--link", broker.url, "--set", "leader.least_delay_s=null"),
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
        )
        async with asyncio.timeout(PATIENCE_S):
            out, err = await process.communicate()
        status = process.returncode
    assert b"Traceback" not in err, err.decode()
    assert status in (0, 1), err.decode()
    summary = json.loads(out)
    # 0.2 s that nobody knows of would be 4 m.
    assert summary["formation"]["mean_error_m"] < 0.6
    assert set(summary["latency"]["vehicles"]) == {"f1", "f2", "f3"}
