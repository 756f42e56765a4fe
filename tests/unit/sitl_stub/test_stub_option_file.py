"""Options of `sitl-stub` in a file."""

import re
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from sitl_stub import cli
from sitl_stub.cli import MOST_BYTES, ConfigError, read_settings
from sitl_stub.options import OptionError
from sitl_stub.settings import Settings


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
    text = {
        "plant": "bank",
        "airspeed_range_m_s": "13,29",
        "wind": "steady:8,90",
        "gusts": ["60,4,6,0"],
        "start": "47,8,500,90",
        "plant_options": ["a=0.5", "b=2"],
    }
    said = {
        "plant": "bank",
        "airspeed_range_m_s": [13, 29],
        "wind": {
            "type": "steady",
            "speed_m_s": 8,
            "toward_deg": 90,
            "gusts": [{"at_s": 60, "for_s": 4, "north_m_s": 6}],
        },
        "start": [47, 8, 500, 90],
        "plant_options": {"a": 0.5, "b": 2},
    }
    one, other = (Settings.of({"system_id": 1, **values}) for values in (text, said))
    assert one.wind.at(5.0) == other.wind.at(5.0)
    assert one.gusts == other.gusts
    assert one.config() == other.config()


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({}, "--system-id: field required"),
        ({"system_id": "x"}, "--system-id: input should be a valid integer"),
        ({"system_id": 1, "alpha_1_s": {"a": 1}}, "--alpha: input should be a valid number"),
        ({"system_id": 1, "wind": {"type": "gale"}}, "--wind: 'gale' is not calm, article"),
        ({"system_id": 1, "gusts": [{"at_s": 3}]}, "length"),
        ({"system_id": 1, "route": 7}, "--route: not LAT,LON;LAT,LON"),
        ({"system_id": 1, "plant_options": {"a": "b"}}, "could not convert string"),
        ({"system_id": 1, "sensors": "best"}, "--sensors: input should be 'ideal', 'rtk'"),
    ],
)
def test_a_wrong_value_is_one_line_with_its_option(values, said):
    with pytest.raises(OptionError, match=re.escape(said)) as caught:
        Settings.of(values)
    assert "\n" not in str(caught.value)


def test_it_tells_its_version():
    assert CliRunner().invoke(cli.app, ["--version"]).output.startswith("sitl-stub ")
