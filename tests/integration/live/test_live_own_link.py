"""The example of a link of one's own, as its author uses it: by command line, from a directory of theirs."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[3]


def vfguide(directory: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Runs a command in a directory that holds nothing but the link."""
    shutil.copy(ROOT / "examples" / "own_link.py", directory)
    return subprocess.run(
        [sys.executable, "-m", "vfguide", *arguments, "--plugin", "own_link.py"],
        cwd=directory,
        env={key: value for key, value in os.environ.items() if key != "VFGUIDE_PLUGINS"},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


def test_a_formation_flies_by_it_and_leaves_no_socket_behind(tmp_path: Path) -> None:
    sockets = tmp_path / "sockets"
    link = ("--link", f"unix://{sockets}")
    flown = vfguide(
        tmp_path, "fly", "circle-calm", "--live", *link, "--duration", "40", "--out", "flight"
    )
    # Half of so short a flight is the way into the slots, which its acceptance does not allow for.
    assert flown.returncode in (0, 1), flown.stderr
    summary = json.loads((tmp_path / "flight" / "summary.json").read_text())
    assert summary["formation"]["settle_1m_s"] is not None
    assert list(sockets.iterdir()) == []


def test_a_wrong_address_is_one_line(tmp_path: Path) -> None:
    refused = vfguide(tmp_path, "fly", "circle-calm", "--live", "--link", "unix://sockets")
    assert refused.returncode == 2
    assert refused.stderr.splitlines() == [
        "link address: a unix link has an absolute directory; write unix:///tmp/formation"
    ]
