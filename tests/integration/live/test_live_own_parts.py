"""Examples of one's own in live flights: a link, an autopilot and a plant together, and a law."""

import json
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

from tests.kit.missions import ROOT
from tests.kit.programs import elsewhere

PARTS = ("own_link.py", "own_autopilot.py", "own_plant.py")


def vfguide(
    python: Path, directory: Path, *arguments: str, parts: Sequence[str] = PARTS
) -> subprocess.CompletedProcess[str]:
    """Runs a command in a directory that holds nothing but the examples."""
    for part in parts:
        shutil.copy(ROOT / "examples" / part, directory)
    plugins = [word for part in parts for word in ("--plugin", part)]
    return elsewhere(python, directory, "-m", "vfguide", *arguments, *plugins)


def test_a_formation_flies_by_them_and_leaves_no_socket_behind(tmp_path, installed, speedup):
    sockets = tmp_path / "sockets"
    parts = {
        "vehicles.f1.autopilot": "brief",
        "rehearsal.emulator.plant": "measured",
        # Quick, and as well damped as the first-order hold for which the mission takes it.
        "rehearsal.emulator.plant_options": (
            "{course_frequency_rad_s: 8, course_damping: 3.3, speed_frequency_rad_s: 8, speed_damping: 5}"
        ),
    }
    settings = [word for field, value in parts.items() for word in ("--set", f"{field}={value}")]
    live = ("--live", "--link", f"unix://{sockets}", "--duration", "40", "--out", "flight")
    fast = ("--speedup", f"{speedup:g}")
    flown = vfguide(installed, tmp_path, "fly", "circle-calm", *live, *fast, *settings)
    # Half of so short a flight is the way into the slots, which its acceptance does not allow for.
    assert flown.returncode in (0, 1), flown.stderr
    summary = json.loads((tmp_path / "flight" / "summary.json").read_text())
    assert summary["plant"] == "measured"
    assert summary["formation"]["settle_10m_s"] is not None
    assert list(sockets.iterdir()) == []


def test_a_law_steers_in_the_companions_own_processes(tmp_path, installed, speedup):
    pursuit = ("--controller", "pursuit", "--set", "controller.lookahead_m=25")
    live = ("--live", "--link", "udp://239.255.77.70:17717", "--speedup", f"{speedup:g}")
    ended = ("--duration", "45", "--out", "flight")
    law = ("own_law.py",)
    flown = vfguide(installed, tmp_path, "fly", "line-calm", *pursuit, *live, *ended, parts=law)
    assert flown.returncode in (0, 1), flown.stderr
    summary = json.loads((tmp_path / "flight" / "summary.json").read_text())
    assert (summary["controller"], summary["mode"]) == ("pursuit", "live")
    # In lockstep it is below 0.1 m by then; half of the time is the way into the slots.
    assert summary["formation"]["mean_error_m"] < 1.0
    assert "pursuit" in (tmp_path / "flight" / "report.html").read_text()
    # By the law's name alone no companion would have started.
    refused = vfguide(installed, tmp_path, "fly", "line-calm", *pursuit, *live, *ended, parts=())
    assert refused.returncode == 2
    assert "pursuit: there is no such law" in refused.stderr


def test_a_wrong_address_is_one_line(tmp_path, installed):
    refused = vfguide(
        installed, tmp_path, "fly", "circle-calm", "--live", "--link", "unix://sockets"
    )
    assert refused.returncode == 2
    assert refused.stderr.splitlines() == [
        "link address: a unix link has an absolute directory; write unix:///tmp/formation"
    ]
