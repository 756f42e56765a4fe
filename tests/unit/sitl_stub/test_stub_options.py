from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl_stub import Autopilot, cli

Vehicle = Any  # an emulated autopilot


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--mavlink", "udpin://nowhere"], "write one like udpin://127.0.0.1:14540"),
        (["--system-id", "300"], "system_id must be 1 to 255"),
        (["--wind", "gale"], "--wind: 'gale' is not calm, article or steady:"),
        (["--wind", "steady:5"], "--wind: '5' is not SPEED,TOWARD_DEG"),
        (["--wind", "steady:-1,0"], "--wind: -1 m/s"),
        (["--start", "47,8,nan,0"], "--start: '47,8,nan,0' is not LAT,LON,ALT,COURSE"),
        (["--start", "95,8,500,0"], "latitude_deg"),
        (["--airspeed", "50"], "airspeed_m_s 50.0 is outside"),
        (["--airspeed-range", "20"], "--airspeed-range"),
        (["--max-bank", "95"], "--max-bank: 95"),
        (["--alpha", "-1"], "alpha_1_s must be"),
        (["--speedup", "0"], "--speedup: 0"),
        (["--speedup", "nan"], "--speedup: nan"),
        (["--duration", "-1"], "duration_s must be"),
        (["--epoch", "0"], "--epoch: 0 is more than"),
        (["--seed", "-1"], "--seed: -1"),
        (["--position-noise", "-1"], "position_noise_m must be"),
        (["--truth", "udpin://127.0.0.1:1"], "true states go to"),
        (["--truth", "/nowhere/truth.jsonl"], "cannot be written to"),
        (["--autopilot-version", "1.16"], "add --autopilot px4, or leave it out"),
        (["--count", "0"], "--count: 0 is not 1 to 100"),
        (["--system-id", "200", "--count", "60"], "system_id must be 1 to 255"),
        (["--mavlink", "udpin://127.0.0.1:65530", "--count", "10"], "no 10 ports"),
        (["--plant", "course-hold", "--speed-response", "tecs"], "tecs"),
        (["--roll-time", "0"], "roll_time_s must be"),
        (["--course-dead-time", "-1"], "course_dead_time_s must be"),
        (["--loop-rate", "1"], "loop_rate_hz must be"),
        (["--gps-glitch", "1,2,3"], "--gps-glitch: '1,2,3' is not AT,FOR,N,E"),
        (["--gps-glitch", "-1,2,3,4"], "no fault"),
        (["--delay", "0.1", "--jitter", "0.2"], "jitter"),
        (["--loss", "1"], "loss must be"),
        (["--airspeed-calibration", "3"], "airspeed_calibration must be"),
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


def flown(options: list[str], monkeypatch: pytest.MonkeyPatch) -> Vehicle:
    """What these options let fly."""
    served: list[tuple[Autopilot, object]] = []

    async def serve(emulated: list[tuple[Autopilot, object]], *_: object, **__: object) -> None:
        served.extend(emulated)

    monkeypatch.setattr(cli, "serve_all", serve)
    given = ["--system-id", "1", "--mavlink", "udpin://127.0.0.1:0", "--airborne", *options]
    with pytest.raises(SystemExit) as caught:
        cli.app(given)
    assert caught.value.code == 0
    return served[0][0]


def told(vehicle: Vehicle, name: bytes) -> float:
    """A parameter as a ground station reads it."""
    asked = mavlink.MAVLink_param_request_read_message(1, 1, name, -1)
    data = vehicle.receive(asked.pack(mavlink.MAVLink(None, srcSystem=255, srcComponent=190)))
    (value,) = mavlink.MAVLink(None).parse_buffer(data)
    return float(value.param_value)


@pytest.mark.parametrize(
    ("options", "name", "value"),
    [
        (["--autopilot", "px4"], b"FW_R_LIM", 50.0),
        (["--autopilot", "px4", "--max-bank", "45"], b"FW_R_LIM", 45.0),
        ([], b"ROLL_LIMIT_DEG", 45.0),
    ],
)
def test_the_bank_limit_is_the_autopilot_s_own_where_it_is_not_given(
    options, name, value, monkeypatch
):
    assert told(flown(options, monkeypatch), name) == pytest.approx(value)


def test_px4_flies_its_own_loops_where_no_plant_is_named(monkeypatch):
    plant = flown(["--autopilot", "px4"], monkeypatch).config.plant
    assert (plant.kind, plant.speed_response) == ("npfg", "px4-untrimmed")
    assert plant.alpha_1_s == pytest.approx(0.8796, abs=1e-4)
    assert (plant.roll_time_s, plant.roll_delay_s, plant.course_dead_time_s) == (0.4, 0.2, 0.06)
    changed = flown(
        ["--autopilot", "px4", "--alpha", "0.7", "--speed-response", "px4", "--roll-delay", "0"],
        monkeypatch,
    ).config.plant
    assert (changed.kind, changed.alpha_1_s) == ("npfg", 0.7)
    assert (changed.speed_response, changed.roll_delay_s) == ("px4", 0.0)


@pytest.mark.parametrize("options", [["--autopilot", "px4", "--plant", "heading-hold"], []])
def test_a_plant_that_is_named_is_flown_as_it_is(options, monkeypatch):
    plant = flown(options, monkeypatch).config.plant
    assert (plant.kind, plant.alpha_1_s, plant.speed_response) == (
        *("heading-hold", 1.2),
        "first-order",
    )
    assert (plant.course_dead_time_s, plant.roll_delay_s) == (0.0, 0.0)


@pytest.mark.parametrize("options", [[], ["--autopilot", "betaflight"], ["--no-such-option"]])
def test_what_is_no_option_at_all_is_status_2_without_a_traceback(options, capsys):
    with pytest.raises(SystemExit) as caught:
        cli.app(options)
    assert caught.value.code == 2
    assert "Traceback" not in capsys.readouterr().err
