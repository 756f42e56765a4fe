"""The API pages that are made of the docstrings."""

import os
import subprocess
import sys

from tests.kit.missions import ROOT

SHOWN = {
    "vfguide.html": ("load_mission", "to_dataframe"),
    "vfguide/laws/base.html": ("expected_motion", "m ahead of the leader"),
    "vfguide/guidance/path.html": ("cross_track_error", "positive right of the direction"),
    "vfguide/mavlink/adapter.html": ("AutopilotAdapter",),
    "vfguide/link/carrier.html": ("Carrier",),
    "sitl_stub/plant.html": ("plant",),
}
"""What people extend, and words that have to be on its page."""


PROGRAM = """
import sys
from pathlib import Path
import make_api
from pdoc import render

whole, shown = render.html_module, sys.argv[2:]
render.html_module = lambda one, all: whole(one, all) if one.fullname in shown else ""
make_api.make_pages(Path(sys.argv[1]))
"""
"""Makes the pages as `make docs` does. All names, signatures and texts go into the index of the search; pages
that nobody looks at stay empty, for they take half a minute."""


def test_every_module_that_people_extend_has_a_page(tmp_path):
    modules = [page.removesuffix(".html").replace("/", ".") for page in SHOWN]
    program = [sys.executable, "-c", PROGRAM, tmp_path, *modules]
    docs = {**os.environ, "PYTHONPATH": str(ROOT / "docs")}
    made = subprocess.run(program, cwd=ROOT, env=docs, capture_output=True, text=True, check=False)
    assert (made.returncode, made.stderr) == (0, "")
    for page, words in SHOWN.items():
        text = (tmp_path / page).read_text()
        assert all(word in text for word in words), page
    assert not (tmp_path / "vfguide" / "commands.html").exists()
