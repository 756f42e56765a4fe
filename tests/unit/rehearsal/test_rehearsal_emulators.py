"""The emulator of a live flight is started by a file: it must be the aircraft that lockstep flies."""

import time
from pathlib import Path
from typing import Any

import pytest

from sitl_stub import Autopilot, cli
from vfguide.lab.rehearsal.emulators import emulator_of
from vfguide.lab.rehearsal.live import emulator_command
from vfguide.lab.studies.flown import article_mission
from vfguide.mission import Mission

UNUSUAL_VEHICLE = {
    "autopilot": "px4",
    "alpha_1_s": 0.9,
    "beta_1_s": 0.7,
    "airspeed_range_m_s": [13, 29],
    "max_bank_deg": 40,
    "max_acceleration_m_s2": 1.7,
    "climb_range_m_s": [-2, 2.5],
    "height_delay_s": 1.5,
}
UNUSUAL_EMULATOR = {
    "plant": "bank",
    "guided_p": 9000,
    "roll_time_s": 0.3,
    "roll_delay_s": 0.1,
    "turn_efficiency": 0.8,
    "speed_response": "tecs",
    "course_dead_time_s": 0.15,
    "speed_dead_time_s": 0.25,
    "indicated_airspeed": True,
    "airspeed_calibration": 1.1,
    "loop_rate_hz": 50,
}


def unusual_mission() -> Mission:
    """A mission in which nothing of the aircraft is as it is by default."""
    rehearsal = {
        "emulator": UNUSUAL_EMULATOR,
        "sensors": "sbas",
        "position_noise_m": 0.2,
        "seed": 7,
    }
    wind = {
        "turbulence": "light",
        "roughness_m": 0.03,
        "gusts": [{"at_s": 3, "for_s": 2, "north_m_s": 4, "east_m_s": -1}],
    }
    content = article_mission("circle-wind", {"rehearsal": rehearsal, "wind": wind}).model_dump(
        exclude_unset=True
    )
    content["vehicles"]["f1"].update(UNUSUAL_VEHICLE)
    return Mission.model_validate(content)


def emulator_by_command(
    mission: Mission, name: str, file: Path, monkeypatch: pytest.MonkeyPatch
) -> Autopilot:
    """What the emulator program makes of the file that a live flight starts it with."""
    served: list[Any] = []
    monkeypatch.setattr(cli, "serve_all", lambda fleet, *_arguments, **_named: served.extend(fleet))
    monkeypatch.setattr(cli, "run", lambda _service, _on_hangup: None)
    command = emulator_command(
        mission,
        name,
        file=file,
        mavlink="udpout://127.0.0.1:14540",
        truth="udpout://127.0.0.1:14541",
        epoch_s=time.time(),
        speedup=1.0,
    )
    cli.app(command[command.index("sitl_stub") + 1 :], standalone_mode=False)
    ((emulated, _address),) = served
    assert isinstance(emulated, Autopilot)
    return emulated


@pytest.mark.parametrize("name", ["leader", "f1"])
def test_a_live_flight_flies_the_aircraft_that_lockstep_flies(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mission = unusual_mission()
    live = emulator_by_command(mission, name, tmp_path / "emulator.yaml", monkeypatch)
    lockstep = emulator_of(mission, name)
    assert live.config == lockstep.config
    # The air, too: wind, turbulence, gusts and shear show in what it reports.
    assert live.advance(6.0) == lockstep.advance(6.0)
