"""`vfguide export` writes one file, whole, where it is told, and nothing else."""

from dataclasses import replace
from pathlib import Path

import pytest

from tests.kit.missions import MISSIONS, shipped
from tests.kit.short_flights import ORIGIN, short_flight
from vfguide.commands.export import ENDINGS, export
from vfguide.errors import InputError
from vfguide.record.flight import FlightRecord


@pytest.fixture
def flown(tmp_path: Path) -> Path:
    """The directory of a flight."""
    directory = tmp_path / "flown"
    directory.mkdir()
    short_flight().save(directory / "flight.npz")
    return directory


@pytest.mark.parametrize("ending", ENDINGS)
def test_each_ending_is_a_format(flown, tmp_path, ending):
    out = tmp_path / "out"
    out.mkdir()
    export([flown], out=out / f"flight{ending}")
    assert [one.name for one in out.iterdir()] == [f"flight{ending}"]
    assert [one.name for one in flown.iterdir()] == ["flight.npz"]


def test_another_ending_is_refused(flown, tmp_path):
    with pytest.raises(InputError, match="the ending is the format"):
        export([flown], out=tmp_path / "flight.xlsx")


def test_a_file_that_is_there_stays_without_force(flown, tmp_path):
    out = tmp_path / "a.csv"
    out.write_text("mine", encoding="utf-8")
    with pytest.raises(InputError, match="--force"):
        export([flown], out=out)
    assert out.read_text(encoding="utf-8") == "mine"
    export([flown], out=out, force=True)
    assert out.read_text(encoding="utf-8").startswith("time_s,")


def test_no_link_is_written_through(flown, tmp_path):
    elsewhere = tmp_path / "elsewhere.csv"
    elsewhere.write_text("mine", encoding="utf-8")
    (tmp_path / "a.csv").symlink_to(elsewhere)
    with pytest.raises(InputError, match="symbolic link"):
        export([flown], out=tmp_path / "a.csv", force=True)
    assert elsewhere.read_text(encoding="utf-8") == "mine"


def test_an_export_that_fails_leaves_nothing(tmp_path, flown):
    short_flight(begin_unix_s=-5.0).save(flown / "flight.npz")
    out = tmp_path / "out"
    out.mkdir()
    with pytest.raises(InputError, match="damaged"):
        export([flown], out=out / "a.mcap")
    assert list(out.iterdir()) == []


def test_a_directory_that_is_not_there_is_one_line(flown, tmp_path):
    with pytest.raises(InputError, match="no such directory"):
        export([flown], out=tmp_path / "absent" / "a.csv")


def test_a_mission_says_where_an_old_record_was_flown(tmp_path, flown):
    short_flight(origin=None, mission="line-calm").save(flown / "flight.npz")
    mission = shipped("line-calm")
    export([flown], out=tmp_path / "a.csv", mission=MISSIONS / "line-calm.yaml")
    latitude = (tmp_path / "a.csv").read_text(encoding="utf-8").splitlines()[1].split(",")[3]
    assert float(latitude) == pytest.approx(mission.origin.latitude_deg)


def test_the_mission_of_another_flight_is_refused(tmp_path, flown):
    short_flight(origin=None).save(flown / "flight.npz")
    with pytest.raises(InputError, match="not 'line-calm'"):
        export([flown], out=tmp_path / "a.csv", mission=MISSIONS / "line-calm.yaml")


def test_place_and_time_are_kept_in_the_record(tmp_path):
    short_flight(begin_unix_s=1.79e9).save(tmp_path / "flight.npz")
    record = FlightRecord.load(tmp_path / "flight.npz")
    assert record.begin_unix_s == 1.79e9
    assert record.origin == ORIGIN


@pytest.mark.parametrize("latitude", [91.0, -1e300])
def test_a_record_of_nowhere_on_the_earth_is_damaged(tmp_path, latitude):
    path = tmp_path / "flight.npz"
    short_flight(origin=replace(ORIGIN, latitude_deg=latitude)).save(path)
    with pytest.raises(InputError, match="nowhere on the earth"):
        FlightRecord.load(path)
