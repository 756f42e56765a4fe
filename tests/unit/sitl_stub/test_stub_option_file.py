"""Options of `sitl-stub` on its command line and in a file."""

import re
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace
from typer.testing import CliRunner

from sitl_stub import Autopilot, PlantParameters, cli
from sitl_stub.cli import MOST_BYTES, ConfigError, read_settings
from sitl_stub.config import OptionError
from sitl_stub.settings import Settings
from tests.kit.autopilot import GroundStation


def test_lines_are_options_without_their_dashes(tmp_path):
    file = tmp_path / "fleet.yaml"
    file.write_text('system-id: 3\nairspeed-range: "16,32"\ngust: ["10,5,1", "20,5,1"]\n')
    assert read_settings(file) == {
        "system_id": 3,
        "airspeed_range_m_s": "16,32",
        "gusts": ["10,5,1", "20,5,1"],
    }


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"alfa: 1", "there is no option 'alfa'; did you mean alpha?"),
        (b"- 1", "holds no options; write lines such as alpha: 0.9"),
        (b"", "holds no options"),
        (b"alpha: [", "this is no YAML"),
        (b"\xff\xfe\x00", "this is no YAML"),
        (b"#" * (MOST_BYTES + 1), "larger than 256 KiB"),
    ],
)
def test_a_wrong_file_is_one_line_with_a_remedy(content, said, tmp_path):
    file = tmp_path / "fleet.yaml"
    file.write_bytes(content)
    with pytest.raises(ConfigError, match=re.escape(said)):
        read_settings(file)


@given(st.binary(max_size=200))
def test_whatever_it_holds_is_options_or_refused(content):
    with TemporaryDirectory() as place:
        file = Path(place, "fleet.yaml")
        file.write_bytes(content)
        try:
            options = read_settings(file)
        except ConfigError:
            return
    assert set(options) <= set(Settings.model_fields)


def test_the_command_line_goes_before_the_file(tmp_path, monkeypatch):
    file = tmp_path / "fleet.yaml"
    file.write_text("system-id: 3\nmavlink: udpout://127.0.0.1:1\nalpha: 0.9\nseed: 7\n")
    seen: list[Settings] = []

    def fleet(settings: Settings) -> list[object]:
        seen.append(settings)
        raise ValueError("as far as this goes")

    monkeypatch.setattr(Settings, "fleet", fleet)
    ended = CliRunner().invoke(cli.app, ["--config", str(file), "--seed", "8"])
    assert ended.exit_code == cli.WRONG_INPUT
    (settings,) = seen
    assert (settings.system_id, settings.seed, settings.alpha_1_s) == (3, 8, 0.9)


EMULATOR = """\
system_id: 3
plant: bank
guided_p: 9000
speed_response: tecs
course_dead_time_s: 0.15
wind: {type: steady, speed_m_s: 8, toward_deg: 90, turbulence: light,
  gusts: [{at_s: 60, for_s: 4, north_m_s: 6}]}
airspeed_range_m_s: [13, 29]
start: [47, 8, 500, 90]
"""


def test_a_file_takes_what_a_mission_says_in_its_own_words():
    settings = Settings.of(yaml.safe_load(EMULATOR))
    plant = settings.config().plant
    assert (plant.kind, plant.guided_p_cdeg_rad, plant.speed_response) == ("bank", 9000.0, "tecs")
    assert (plant.airspeed_min_m_s, plant.course_dead_time_s) == (13.0, 0.15)
    # the wind blows east, and nothing of it north
    assert settings.wind.at(0.0) == pytest.approx((0.0, 8.0), abs=1e-12)
    (gust,) = settings.gusts
    assert (settings.turbulence, gust.start_s, gust.north_m_s) == ("light", 60.0, 6.0)


def test_what_a_mission_says_and_options_are_the_same_settings():
    """The turbulence and the kinds of the emulator's own file are told in the same words by both."""
    said = yaml.safe_load(EMULATOR) | {"plant_options": {"a": 0.5, "b": 2}}
    text = said | {
        "airspeed_range_m_s": "13,29",
        "wind": "steady:8,90",
        "turbulence": "light",
        "gusts": ["60,4,6,0"],
        "start": "47,8,500,90",
        "plant_options": ["a=0.5", "b=2"],
    }
    one, other = (Settings.of(values) for values in (text, said))
    assert one.wind.at(5.0) == other.wind.at(5.0)
    assert (one.gusts, one.turbulence) == (other.gusts, other.turbulence)
    assert one.config() == other.config()


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({}, "--system-id: is missing; see sitl-stub --help"),
        ({"system_id": "x"}, "--system-id: input should be a valid integer"),
        ({"system_id": 1, "alpha_1_s": {"a": 1}}, "--alpha: input should be a valid number"),
        ({"system_id": 1, "wind": {"type": "gale"}}, "--wind: 'gale' is not calm, article"),
        ({"system_id": 1, "gusts": [{"at_s": 3}]}, "length"),
        ({"system_id": 1, "route": 7}, "--route: not LAT,LON;LAT,LON"),
        ({"system_id": 1, "plant_options": {"a": "b"}}, "--plant-option: a=b is not NAME=NUMBER"),
        ({"system_id": 1, "plant_options": {"a": None}}, "--plant-option: a=None is not"),
        ({"system_id": 1, "sensors": "best"}, "--sensors: input should be 'ideal', 'rtk'"),
    ],
)
def test_a_wrong_value_is_one_line_with_its_option(values, said):
    with pytest.raises(OptionError, match=re.escape(said)) as caught:
        Settings.of(values)
    assert "\n" not in str(caught.value)


def test_it_tells_its_version():
    assert CliRunner().invoke(cli.app, ["--version"]).output.startswith("sitl-stub ")


OUT_OF_RANGE = [
    *(
        ("--component-id", "0"),
        ("--component-id", "256"),
        ("--vehicle-type", "-1"),
        ("--uid", "-1"),
    ),
    *(("--speedup", "nan"), ("--duration", "-1"), ("--seed", "-1"), ("--position-noise", "-1")),
    *(("--loop-rate", "1"), ("--airspeed-calibration", "3")),
]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--mavlink", "udpin://nowhere"], "write one like udpin://127.0.0.1:14540"),
        (["--system-id", "300"], "--system-id: input should be less than or equal to 255"),
        (["--system-id", "0"], "--system-id: input should be greater than or equal to 1"),
        *(([option, value], f"{option}: input should be") for option, value in OUT_OF_RANGE),
        (["--wind", "gale"], "--wind: 'gale' is not calm, article or steady:"),
        (["--wind", "steady:5"], "--wind: '5' is not SPEED,TOWARD_DEG"),
        (["--wind", "steady:-1,0"], "--wind: -1 m/s"),
        (["--start", "47,8,nan,0"], "--start: '47,8,nan,0' is not LAT,LON,ALT,COURSE"),
        (["--start", "95,8,500,0"], "latitude_deg"),
        (["--airspeed", "50"], "airspeed_m_s 50.0 is outside"),
        (["--airspeed-range", "20"], "--airspeed-range"),
        (["--max-bank", "95"], "--max-bank: 95"),
        (["--alpha", "-1"], "alpha_1_s must be"),
        (["--speedup", "0"], "--speedup: input should be greater than 0"),
        (["--epoch", "0"], "--epoch: 0 is more than"),
        (["--truth", "udpin://127.0.0.1:1"], "true states go to"),
        (["--truth", "udpout://127.0.0.1"], "write one like"),
        (["--truth-rate", "0"], "--truth-rate: input should be greater than 0"),
        (["--epoch", "inf"], "--epoch: input should be a finite number"),
        (["--truth", "/nowhere/truth.jsonl"], "cannot be written to"),
        (["--autopilot-version", "1.16"], "add --autopilot px4, or leave it out"),
        (["--count", "0"], "--count: 0 is not 1 to 100"),
        (["--system-id", "200", "--count", "60"], "--system-id: input should be less than"),
        (["--mavlink", "udpin://127.0.0.1:65530", "--count", "10"], "no 10 ports"),
        (
            ["--count", "2", "--also-to", "udpout://127.0.0.1:1"],
            "--also-to: is not for --count; start an emulator for each aircraft",
        ),
        (["--plant", "course-hold", "--speed-response", "tecs"], "tecs"),
        (["--roll-time", "0"], "roll_time_s must be"),
        (["--course-dead-time", "-1"], "course_dead_time_s must be"),
        (["--gps-glitch", "1,2,3"], "--gps-glitch: '1,2,3' is not AT,FOR,N,E"),
        (["--gps-glitch", "-1,2,3,4"], "no fault"),
        (["--delay", "0.1", "--jitter", "0.2"], "jitter"),
        (["--loss", "1"], "loss must be"),
    ],
)
def test_a_wrong_option_is_one_line_and_status_2(options, said, capsys):
    given = ["--system-id", "1", "--mavlink", "udpin://127.0.0.1:0", *options]
    with pytest.raises(SystemExit) as caught:
        cli.app(given)
    assert caught.value.code == 2
    errors = capsys.readouterr().err
    assert errors.count("\n") == 1
    assert errors.startswith("sitl-stub: ")
    assert said in errors


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--system-id", "one"], "invalid value for '--system-id'"),
        (["--sensors", "good"], "invalid value for '--sensors'"),
        (["--no-such-option"], "no such option: --no-such-option"),
        (["file.yaml"], "unexpected extra argument"),
        (["--mavlink", "udpin://127.0.0.1:0"], "--system-id: is missing; see sitl-stub --help"),
    ],
)
def test_a_wrong_command_line_is_one_line_and_status_2(options, said, capsys, monkeypatch):
    monkeypatch.setattr("sys.argv", ["sitl-stub", *options])
    with pytest.raises(SystemExit) as caught:
        cli.main()
    assert caught.value.code == 2
    errors = capsys.readouterr().err
    assert errors.count("\n") == 1
    assert said in errors


def emulated(options: list[str], monkeypatch: pytest.MonkeyPatch) -> GroundStation:
    """What these options let fly."""
    served: list[tuple[Autopilot, object]] = []

    async def serve(emulated: list[tuple[Autopilot, object]], *_: object, **__: object) -> None:
        served.extend(emulated)

    monkeypatch.setattr(cli, "serve_all", serve)
    given = ["--system-id", "7", "--mavlink", "udpin://127.0.0.1:0", "--airborne", *options]
    assert CliRunner().invoke(cli.app, given).exit_code == 0
    return GroundStation(served[0][0])


@pytest.mark.parametrize(
    ("options", "name", "value"),
    [
        (["--autopilot", "px4"], "FW_R_LIM", 50.0),
        (["--autopilot", "px4", "--max-bank", "45"], "FW_R_LIM", 45.0),
        ([], "ROLL_LIMIT_DEG", 45.0),
    ],
)
def test_the_bank_limit_is_the_autopilot_s_own_where_it_is_not_given(
    options, name, value, monkeypatch
):
    assert emulated(options, monkeypatch).read(name).param_value == pytest.approx(value)


def test_px4_flies_its_own_loops_where_no_plant_is_named(monkeypatch):
    plant = emulated(["--autopilot", "px4"], monkeypatch).autopilot.config.plant
    assert (plant.kind, plant.speed_response) == ("npfg", "px4-untrimmed")
    assert plant.alpha_1_s == pytest.approx(0.8796, abs=1e-4)
    assert (plant.roll_time_s, plant.roll_delay_s, plant.course_dead_time_s) == (0.4, 0.2, 0.06)
    changed = emulated(
        ["--autopilot", "px4", "--alpha", "0.7", "--speed-response", "px4", "--roll-delay", "0"],
        monkeypatch,
    ).autopilot.config.plant
    assert (changed.kind, changed.alpha_1_s) == ("npfg", 0.7)
    assert (changed.speed_response, changed.roll_delay_s) == ("px4", 0.0)


@pytest.mark.parametrize("options", [["--autopilot", "px4", "--plant", "heading-hold"], []])
def test_a_plant_that_is_named_is_flown_as_it_is(options, monkeypatch):
    plant = emulated(options, monkeypatch).autopilot.config.plant
    # But for the bank limit, which is the autopilot's own.
    assert replace(plant, max_bank_rad=PlantParameters().max_bank_rad) == PlantParameters()


@pytest.mark.parametrize("options", [[], ["--autopilot", "betaflight"], ["--no-such-option"]])
def test_what_is_no_option_at_all_is_status_2_without_a_traceback(options):
    ended = CliRunner().invoke(cli.app, options)
    assert ended.exit_code == cli.WRONG_INPUT
    assert "Traceback" not in ended.output
