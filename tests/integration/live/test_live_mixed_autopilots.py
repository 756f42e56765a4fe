"""One formation of different autopilots: an ArduPlane leads, a PX4 follows, and another by way of MAVSDK."""

import json

from tests.kit.programs import vfguide

MISSION = """\
name: mixed
origin: {latitude_deg: 47.397742, longitude_deg: 8.545594, altitude_amsl_m: 488}
path: {type: circle, centre: {north_m: 200, east_m: 0}, radius_m: 200, direction: clockwise, gain: 0.015}
leader: {vehicle: leader, airspeed_m_s: 20}
followers:
  - {vehicle: f1, slot: {forward_m: -25, right_m: -25}}
  - {vehicle: f2, slot: {forward_m: -25, right_m: 25}}
vehicles:
  leader: {system_id: 1, autopilot: auto}
  f1: {system_id: 2, autopilot: px4}
  f2: {system_id: 3, autopilot: mavsdk}
wind: {type: steady, speed_m_s: 3, toward_deg: 90}
rehearsal: {duration_s: 80, rate_hz: 20}
acceptance: {min_separation_m: 10}
"""


async def test_a_formation_of_three_kinds_of_autopilot_is_one_formation(
    mosquitto, tmp_path, speedup
):
    mission = tmp_path / "mixed.yaml"
    mission.write_text(MISSION)
    link = ("--speedup", f"{speedup:g}", "--link", mosquitto().url)
    flown = await vfguide("fly", mission, "--live", "--json", *link)
    summary = json.loads(flown.out)
    # Errors are of the second half: until then MAVSDK has found its autopilot, and its aircraft its slot.
    assert summary["formation"]["mean_error_m"] < 1.0
    assert summary["formation"]["min_separation_m"] > 10.0
