"""Directories that a flight leaves, and what replaces them."""

import json

import pytest

from vfguide.commands.output import flown_before, move_into


@pytest.mark.parametrize("name", ["../kept", "sub/f1", "/kept"])
def test_nothing_beside_the_directory_goes_whatever_its_summary_says(name, tmp_path):
    out, partial = tmp_path / "out", tmp_path / "partial"
    out.mkdir()
    partial.mkdir()
    kept = tmp_path / "kept.tlog"
    kept.write_bytes(b"of another flight")
    (out / "summary.json").write_text(json.dumps({"mission": "line", "vehicles": ["f2", name]}))
    assert flown_before(out) is None
    move_into(out, partial)
    assert kept.read_bytes() == b"of another flight"
