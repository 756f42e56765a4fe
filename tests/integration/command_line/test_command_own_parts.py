"""Examples of parts of one's own, as their authors use them: by command line, from a directory of theirs."""

import json
import re
import shutil
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
import yaml

from tests.kit.missions import MISSIONS, ROOT
from tests.kit.programs import elsewhere, loaded

LAW, PATH, PLANT = "own_law.py", "own_path.py", "own_plant.py"
LEADER_LAW, AUTOPILOT = "own_leader_law.py", "own_autopilot.py"
EMULATED = "own_emulated_autopilot.py"

Run = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture
def here(tmp_path: Path) -> Path:
    """A directory that holds nothing but the examples."""
    place = tmp_path / "here"
    place.mkdir()
    for example in (ROOT / "examples").glob("own_*.py"):
        shutil.copy(example, place)
    return place


def plugged(words: Sequence[str | Path], plugin: str | None) -> tuple[str | Path, ...]:
    """Words of a command line that names a plugin, if any."""
    return (*words, *(() if plugin is None else ("--plugin", plugin)))


@pytest.fixture
def run(here: Path) -> Run:
    """Runs vfguide there; it is told of one of the examples at most."""
    return lambda *words, plugin=None: loaded(here, "vfguide", *plugged(words, plugin))


def the_line(refused: subprocess.CompletedProcess[str]) -> str:
    """The one line by which something is refused."""
    assert refused.returncode == 2, refused.stdout
    (line,) = refused.stderr.splitlines()
    return line


def summary_of(flown: subprocess.CompletedProcess[str], *statuses: int) -> dict:
    """What a flight with --json has told."""
    assert flown.returncode in (statuses or (0, 1)), flown.stderr
    return json.loads(flown.stdout)


def setting(text: str) -> tuple[str, str]:
    """A field of the mission that is otherwise."""
    return ("--set", text)


CALM = "circle-calm"
PURSUIT = ("line-calm", "--controller", "pursuit")
AHEAD = setting("controller.lookahead_m=25")
CARROT = setting("leader.law=carrot")
MEASURED = ("--plant", "measured")
BRIEF = setting("vehicles.f1.autopilot=brief")
SHORT = ("--duration", "60", "--rate", "10", "--json")
KINDS_OF_PATH = "line, circle, helix, racetrack, figure-eight, waypoints, plan"
KINDS = "ardupilot, px4"


def path(fields: str) -> tuple[str, ...]:
    """A mission on another path."""
    return (CALM, *setting(f"path={{{fields}}}"))


def gain(text: str) -> tuple[str, ...]:
    """A mission with a gain of the leader's own law."""
    return (CALM, *CARROT, *setting(f"leader.gains.{text}"))


def emulated(text: str) -> tuple[str, ...]:
    """A mission with another emulator."""
    return (CALM, *setting(f"rehearsal.emulator.{text}"))


@pytest.mark.parametrize(
    ("words", "plugin", "said"),
    [
        ((*PURSUIT, *setting("controller.lookahead_m=-3")), LAW, "-3 is too small"),
        ((*PURSUIT, *setting("controller.lokahead_m=3")), LAW, "did you mean 'lookahead_m'?"),
        (PURSUIT, None, "pursuit: there is no such law; known are slot, article, pid, mpc"),
        (PURSUIT, "absent.py", "absent.py: there is no such file of Python"),
        (PURSUIT, "broken.py", "broken.py:2: NameError"),
        ((CALM, *CARROT), None, "--set leader.law: 'carrot' is not known; use one of: field"),
        (gain("lookahad_m=3"), LEADER_LAW, "lookahad_m: Extra inputs are not permitted"),
        (gain("lookahead_m=-3"), LEADER_LAW, "lookahead_m: Input should be greater than 0"),
        (path("type: lissajous, half_length_m: -3"), PATH, "-3 is too small; choose above 0"),
        (path("type: lissajous, half_lenght_m: 3"), PATH, "did you mean 'half_length_m'?"),
        (path("type: lissajous, centre: {north: 3}"), PATH, "did you mean 'north_m'?"),
        (path("type: lissajoux"), PATH, "did you mean 'lissajous'?"),
        (path("half_length_m: 3"), PATH, f"add one of: {KINDS_OF_PATH}, lissajous"),
        (path("type: raising"), "raising.py", "raising.py:14: ZeroDivisionError: float"),
        ((CALM, *BRIEF), None, f"'brief' is not known; use one of: auto, {KINDS}, mavsdk"),
        ((CALM, *setting("vehicles.f1.autopilot=breif")), AUTOPILOT, "did you mean 'brief'?"),
        ((CALM, *BRIEF), "partly.py", ": the autopilot brief has no hand_back; write it"),
        (emulated("autopilot=brief"), None, f"'brief' is not known; use one of: {KINDS}"),
        (emulated("plant=mesured"), PLANT, "did you mean 'measured'?"),
    ],
)
def test_what_is_wrong_is_one_line(run, here, words, plugin, said):
    (here / "broken.py").write_text("import math\nmath.pi + tau\n")
    (here / "raising.py").write_text(RAISES)
    text = (here / AUTOPILOT).read_text()
    before, after = text.index("    def hand_back"), text.index("    def fly")
    (here / "partly.py").write_text(text[:before] + text[after:])
    assert said in the_line(run("check", *words, plugin=plugin))


RAISES = """
from vfguide.paths import Path, PathPlace, PathShape, path

@path("raising")
class Raising(Path):
    Shape = PathShape
    length = 1000.0

    @classmethod
    def of(cls, shape):
        return cls()

    def nearest(self, north, east, course=None):
        return 1.0 / 0.0

    def at(self, progress):
        return PathPlace(progress, progress, 0.0 * progress, 0.0 * progress)
"""


def test_a_law_is_flown_and_reported_under_its_name(here, installed):
    """By vfguide from its wheel, in as many processes as there are processors."""
    words = ("vfguide", "fly", *PURSUIT, *AHEAD, "--duration", "40", "--out", "flight")
    flown = elsewhere(installed, here, "-m", *plugged(words, LAW))
    assert flown.returncode == 0, flown.stderr
    summary = json.loads((here / "flight" / "summary.json").read_text())
    assert summary["controller"] == "pursuit"
    assert summary["formation"]["mean_error_m"] < 0.5
    assert "pursuit" in (here / "flight" / "report.html").read_text()


def with_law(content: dict) -> None:
    content["controller"] = {"type": "pursuit", "lookahead_m": 25}


def with_path(content: dict) -> None:
    content["path"] = {"type": "lissajous", "half_length_m": 600}
    content["rehearsal"].pop("start", None)


@pytest.mark.parametrize(
    ("change", "plugin", "said"),
    [
        (with_law, LAW, "'pursuit' is not known; use one of: slot, article, pid, mpc"),
        (with_path, PATH, f"'lissajous' is not known; use one of: {KINDS_OF_PATH}"),
    ],
)
def test_a_mission_file_may_name_a_part_but_nothing_is_loaded_by_its_name(
    run, here, change, plugin, said
):
    mission = yaml.safe_load((MISSIONS / "circle-calm.yaml").read_text())
    change(mission)
    (here / "own.yaml").write_text(yaml.safe_dump(mission))
    flown = run("fly", "own.yaml", "--duration", "1", "--json", plugin=plugin)
    law = mission["controller"].get("type", "slot")
    assert summary_of(flown)["controller"] == law
    assert said in the_line(run("check", "own.yaml"))


def test_scenarios_drawn_anew_are_flown_by_a_law_and_no_other_in_its_place(run):
    study = ("bench", "monte-carlo", "--formations", "1", "--processes", "1", "--seed", "3")
    flown = run(*study, "--law", "pursuit", "--law", "slot", plugin=LAW)
    assert flown.returncode == 0, flown.stderr
    heading, *rows = flown.stdout.splitlines()
    assert heading.endswith(", 1 scenarios, seed 3")
    found = re.findall(r"^\| (pursuit|slot) (.*)$", "\n".join(rows), re.MULTILINE)
    figures = dict(found)
    assert figures.keys() == {"pursuit", "slot"}
    assert figures["pursuit"] != figures["slot"]


STUDIES = """
import json
from dataclasses import replace
from pathlib import Path
from vfguide.lab.studies.comparison import Extent, ablation_cases, cases, rows, sweep_cases
from vfguide.lab.studies.flown import fly
from vfguide.registry import use_plugins

use_plugins([Path("own_law.py")])
short = Extent(duration_s=6.0, seeds=1, bad_link_plants=())
compared, switched, swept = {}, {}, {}
for law in ("pursuit", "slot"):
    (case, *_) = cases(short, [law])
    ((_, figures),) = rows([(case, fly(case))])
    compared[law] = figures["mean_m"]
    parts = ablation_cases(law, quick=True)
    case = next(one for one in parts if one.label == "no wind filter")
    figures = fly(replace(case, changes=case.changes | {"rehearsal": {"duration_s": 6.0}}))
    switched[law] = figures.mean_error_m
    swept[law] = {}
    for sweep in ("link delay", "true alpha"):
        swept_by = sweep_cases([law], quick=True)
        case = next(one for one in swept_by if one.label.startswith(sweep))
        short_one = case.changes["rehearsal"] | {"duration_s": 6.0}
        figures = fly(replace(case, changes=case.changes | {"rehearsal": short_one}))
        swept[law][sweep] = figures.mean_error_m
print(json.dumps({"compared": compared, "switched": switched, "swept": swept}))
"""
"""A flight of each study of `bench` by the own law and by the field, for six seconds instead of minutes."""


def test_each_study_flies_a_law_and_no_other_in_its_place(here):
    (here / "studies.py").write_text(STUDIES)
    found = summary_of(loaded(here, "studies"), 0)
    for study in (found["compared"], found["switched"]):
        assert study["pursuit"] != study["slot"]
        assert 0.0 < study["pursuit"] < 100.0
    assert found["swept"]["pursuit"].keys() == found["swept"]["slot"].keys()
    for sweep, error_m in found["swept"]["pursuit"].items():
        assert error_m != found["swept"]["slot"][sweep]


def test_the_leader_flies_by_a_law_and_its_gain_counts(run):
    # Started 30 m beside its line, a leader that aims 40 m ahead decays to it with about 40 m: 20 s at
    # 20 m/s are ten of them. One that aims 400 m ahead is still on its way: after 40 s 30 m e^(-2) are 4 m.
    errors = []
    for ahead in (40, 400):
        words = ("fly", "line-calm", *CARROT, *setting(f"leader.gains.lookahead_m={ahead}"))
        flown = run(*words, "--duration", "40", "--rate", "10", "--json", plugin=LEADER_LAW)
        leader = summary_of(flown)["vehicles"]["leader"]
        errors.append(leader["cross_track_error_m"]["mean"])
    near, far = errors
    assert near < 0.05
    assert far > 4.0


def test_a_formation_flies_both_loops_of_the_eight_and_over_itself_where_it_has_a_bridge(run):
    words = ("fly", *path("type: lissajous, bridge_m: 40"), *setting("rehearsal.start={}"))
    long = ("--duration", "200", "--rate", "10", "--json")
    summary = summary_of(run(*words, *long, plugin=PATH), 0)
    assert summary["formation"]["mean_error_m"] < 0.05
    assert summary["formation"]["mean_error_3d_m"] < 0.1
    assert summary["vehicles"]["leader"]["cross_track_error_m"]["max"] < 0.05


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        # Ten times as high on the same way is ten times as steep.
        ("bridge_m: 400", "the path climbs at up to"),
        # Its tightest turns, beside where it is widest, have a radius of 23.9 m: atan(20²/23.9/9.81) = 60°.
        ("half_length_m: 200", "'leader' has to bank 60°"),
    ],
)
def test_a_path_that_is_too_steep_or_too_tight_for_the_vehicles_is_found(run, fields, said):
    checked = run("check", *path(f"type: lissajous, {fields}"), plugin=PATH)
    assert checked.returncode == 2
    assert said in checked.stdout


def test_a_mission_is_flown_by_a_plant_and_its_numbers_count(run):
    figures = []
    for damping in (0.8, 0.2):
        option = emulated(f"plant_options.course_damping={damping}")
        summary = summary_of(run("fly", *option, *MEASURED, *SHORT, plugin=PLANT))
        assert summary["plant"] == "measured"
        figures.append(summary["formation"]["mean_error_m"])
    usual, swinging = figures
    assert usual < 5.0
    assert swinging > 2.0 * usual


@pytest.mark.parametrize(
    ("words", "plugin", "said"),
    [
        ((CALM,), None, "--plant: 'measured' is not known; use one of: course-hold, "),
        (emulated("plant_options.curse=1"), PLANT, "measured has no option curse; it has course_"),
    ],
)
def test_a_plant_that_cannot_be_flown_is_one_line(run, words, plugin, said):
    assert said in the_line(run("fly", *words, *MEASURED, plugin=plugin))


OWN_PLANT = ("--plugin", PLANT, *MEASURED)
STUB = ("sitl_stub", "--system-id", "1", "--airborne", "--mavlink")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (MEASURED, "--plant: measured is not one of heading-hold, course-hold"),
        (("--plugin", "absent.py"), "--plugin absent.py: there is no such file of Python"),
        ((*OWN_PLANT, "--plant-option", "curse=1"), "measured has no option curse"),
        ((*OWN_PLANT, "--plant-option", "curse"), "--plant-option: curse= is not NAME=NUMBER"),
        (("--autopilot", "brief"), f"sitl-stub: --autopilot: brief is not one of {KINDS}"),
    ],
)
def test_what_is_wrong_for_the_emulator_alone_is_one_line(here, words, said):
    assert said in the_line(loaded(here, *STUB, "udpout://127.0.0.1:9", *words))


def test_the_emulator_is_started_with_an_autopilot_by_its_name(here):
    own = ("--plugin", EMULATED, "--autopilot", "brief", "--duration", "1", "--speedup", "100")
    ended = loaded(here, *STUB, "udpin://127.0.0.1:0", *own)
    assert ended.returncode == 0, ended.stderr


def test_a_whole_formation_flies_by_an_autopilot_as_by_vfguides_own(run):
    names = ("leader", "f1", "f2", "f3")
    settings = [word for name in names for word in setting(f"vehicles.{name}.autopilot=brief")]
    formation = summary_of(run("fly", CALM, *settings, *SHORT, plugin=AUTOPILOT))["formation"]
    assert formation["mean_error_m"] < 0.1
    assert formation["settle_1m_s"] < 40.0


def test_a_formation_flies_against_an_emulated_autopilot_of_the_user_s(run):
    # Its aircraft is the mission's, of first order.
    summary = summary_of(run("fly", *emulated("autopilot=brief"), *SHORT, plugin=EMULATED))
    assert summary["formation"]["mean_error_m"] < 0.1
