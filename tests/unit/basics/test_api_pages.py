"""The API pages that are made of the docstrings."""

import subprocess
import sys

from tests.kit.missions import ROOT

SHOWN = {
    "vfguide.html": ("load_mission", "to_dataframe"),
    "vfguide/laws/base.html": ("expected_motion", "m ahead of the follower"),
    "vfguide/guidance/path.html": ("cross_track_error", "positive right of the direction"),
    "vfguide/mavlink/adapter.html": ("AutopilotAdapter",),
    "vfguide/link/carrier.html": ("Carrier",),
    "sitl_stub/plant.html": ("plant",),
}
"""What people extend, and words that have to be on its page."""


def test_every_module_that_people_extend_has_a_page(tmp_path):
    program = [sys.executable, ROOT / "docs" / "make_api.py", tmp_path]
    made = subprocess.run(program, cwd=ROOT, capture_output=True, text=True, check=False)
    assert (made.returncode, made.stderr) == (0, "")
    for page, words in SHOWN.items():
        text = (tmp_path / page).read_text()
        assert all(word in text for word in words), page
    assert not (tmp_path / "vfguide" / "commands.html").exists()
