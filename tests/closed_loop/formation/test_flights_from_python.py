"""Flying from Python, as the documentation shows it."""

import json
import shutil
from itertools import product

import numpy as np
import pytest

import vfguide
from tests.kit.missions import IN_PLACE, MISSIONS, ROOT, in_place, shipped
from tests.kit.programs import elsewhere
from vfguide.errors import InputError
from vfguide.lab.report import plots
from vfguide.laws import Law

MISSION = MISSIONS / "line-calm.yaml"


def test_a_flight_has_its_figures_and_its_data_by_vehicle(tmp_path, monkeypatch):
    mission = vfguide.load_mission(str(MISSION))
    flight = vfguide.fly(mission, duration_s=10.0, seed=2, settings={"controller.k_x": 0.3})
    assert list(flight.tracks) == ["leader", "f1", "f2", "f3"]
    assert flight.time_s.shape == flight.tracks["f2"].north_m.shape == (201,)
    assert flight.tracks["f2"].north_m.dtype == np.float64
    window = flight.time_s >= 5.0
    mean = np.mean([error.distance_m[window] for error in flight.errors.values()])
    assert flight.summary.formation.mean_error_m == pytest.approx(mean)
    assert (flight.summary.seed, flight.summary.duration_s) == (2, 10.0)
    monkeypatch.setattr(plots, "PLOTS", plots.PLOTS[:1])
    flight.report(tmp_path / "out")
    assert (tmp_path / "out" / "report.html").exists()
    # What is flown is what the mission says, but for what is given.
    usual = vfguide.fly(mission, duration_s=5.0, seed=2).tracks["f1"].north_m
    assert not np.array_equal(usual, flight.tracks["f1"].north_m[: usual.size])


def test_laws_are_compared_over_the_same_seeds():
    mission = shipped("line-calm")
    found = vfguide.compare(mission, laws=["slot", "pid"], seeds=[1, 2], duration_s=3.0)
    expected = [("slot", 1), ("slot", 2), ("pid", 1), ("pid", 2)]
    assert [(one.law, one.seed) for one in found] == expected
    assert [one.summary.controller for one in found] == ["slot", "slot", "pid", "pid"]


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"law": "solt"}, "solt: there is no such law; known are slot, article"),
        ({"settings": {"controller.k_z": 1.0}}, r"controller\.k_z: unknown field"),
        ({"settings": {"controller.boundary_layer_factor": 0.1}}, "boundary_layer_factor"),
        ({"law": type("Nameless", (Law,), {})}, "Nameless: the law has no name"),
    ],
)
def test_what_cannot_be_flown_is_said(changes, said):
    with pytest.raises(InputError, match=said):
        vfguide.fly(shipped("line-calm"), **changes)


def test_the_public_names_are_those_that_are_documented():
    assert dir(vfguide) == sorted(vfguide.__all__)
    with pytest.raises(AttributeError, match="no attribute 'flee'"):
        vfguide.flee  # noqa: B018


def test_every_combination_of_settings_is_flown_and_is_a_row_of_a_table():
    mission = shipped("line-calm")
    swept = {"controller.k_x": [0.2, 0.4], "rehearsal.link_loss": [0.0, 0.5, 0.9]}
    metrics = [flown_s, greatest_bank]
    found = vfguide.compare(mission, settings=swept, metrics=metrics, duration_s=3.0)
    expected = list(product((0.2, 0.4), (0.0, 0.5, 0.9)))
    assert [tuple(one.settings.values()) for one in found] == expected
    row = found[-1].row()
    assert (row["law"], row["seed"], row["controller.k_x"]) == ("slot", 1, 0.4)
    assert row["flown_s"] == 3.0
    assert row["mean_error_m"] == found[-1].summary.formation.mean_error_m
    assert found[0].metrics["greatest_bank"] != found[3].metrics["greatest_bank"]


def raises(flight: vfguide.Flight) -> float:
    raise KeyError(flight.summary.mission)


@pytest.mark.parametrize(
    ("what", "said"),
    [
        (
            {"settings": {"controller.k_x": 0.3}},
            r'settings of compare are lists of values; write \{"co',
        ),
        ({"laws": "slot"}, "laws and seeds are lists"),
        ({"metrics": raises}, "metrics is a list of functions"),
        (
            {"metrics": [raises], "duration_s": 2.0},
            r"metric raises fails \(KeyError in .*law slot, seed 1",
        ),
    ],
)
def test_what_cannot_be_compared_is_one_line(what, said):
    with pytest.raises(InputError, match=said):
        vfguide.compare(shipped("line-calm"), **what)


def test_the_name_of_a_mission_is_no_mission():
    with pytest.raises(InputError, match=r"'circle-calm' is no mission; write vfguide\.load_mis"):
        vfguide.fly("circle-calm")  # type: ignore[arg-type]


def flown_s(flight: vfguide.Flight) -> float:
    return float(flight.time_s[-1])


def greatest_bank(flight: vfguide.Flight) -> float:
    return max(float(np.abs(flight.tracks[name].bank_rad).max()) for name in flight.errors)


def test_a_flight_as_a_data_frame_has_a_row_for_each_sample_and_vehicle():
    flight = vfguide.fly(vfguide.load_mission(MISSION), duration_s=2.0)
    frame = flight.to_dataframe()
    assert len(frame) == 4 * 41
    mine = frame[frame.vehicle == "f2"]
    assert mine.north_m.to_numpy() == pytest.approx(flight.tracks["f2"].north_m)
    assert mine.slot_distance_m.to_numpy() == pytest.approx(flight.errors["f2"].distance_m)
    assert frame[frame.role == "leader"].slot_distance_m.isna().all()
    assert set(frame["mode"]) <= set(flight.record.mode_names)


def test_the_notebook_prints_the_articles_table(tmp_path, installed):
    cells = json.loads((ROOT / "examples" / "article_table.ipynb").read_text())["cells"]
    code = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    script = "\n".join(code).replace("DURATION_S = 300.0", "DURATION_S = 16.0")
    settings = {"rehearsal.rate_hz": 10.0, "rehearsal.start": IN_PLACE}
    script = script.replace("=DURATION_S)", f"=DURATION_S, {settings=})")
    assert script.count("16.0") == script.count("10.0") == 1
    ran = elsewhere(installed, tmp_path, "-c", script, MPLBACKEND="agg")
    assert ran.returncode == 0, ran.stderr
    rows = {line.split()[0]: line.split()[1:] for line in ran.stdout.splitlines()[1:]}
    assert list(rows) == ["line-calm", "line-wind", "circle-calm", "circle-wind"]
    for claimed, article, slot in (map(float, row) for row in rows.values()):
        assert slot < 0.1 < claimed
        assert slot < article + 0.1
    # Round the circle, the article's slots move otherwise than a rigid formation's.
    assert float(rows["circle-calm"][1]) > 1.0


@pytest.mark.parametrize(
    ("example", "said"),
    [
        ("fly_in_python.py", "mean error over the last half: 0.0"),
        ("own_metric.py", "slot: 0.0"),
        ("sweep.py", "controller.k_x\tcontroller.k_y\tseed\tmean_error_m"),
    ],
)
def test_the_examples_run_where_they_are_copied_to(tmp_path, installed, example, said):
    shutil.copy(ROOT / "examples" / "own_law.py", tmp_path)
    mission = tmp_path / "in-place.yaml"
    content = in_place("line-calm", rate_hz=10.0).model_dump_json(exclude_unset=True)
    mission.write_text(content)
    script = (ROOT / "examples" / example).read_text()
    script = script.replace("DURATION_S = 60.0", "DURATION_S = 12.0")
    script = script.replace("duration_s=40.0", "duration_s=12.0")
    assert "60.0" not in script
    assert "40.0" not in script
    (tmp_path / example).write_text(script)
    ran = elsewhere(installed, tmp_path, example, mission)
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.startswith(said)
    # The last line is the last law, or the worst of all combinations.
    last = {"fly_in_python.py": "pursuit, seed 1: ", "own_metric.py": "pid: ", "sweep.py": "0."}
    assert ran.stdout.splitlines()[-1].startswith(last[example])
