"""The numbers of a vehicle in each sample of the console, and how they are written."""

from vfguide.companion.supervisor import Mode
from vfguide.lab.report.replay.data import KINDS, SLOT_KINDS, Kind

MODES = (*(mode.value for mode in Mode), "offline", "not known")
"""What a card can show, by number."""

SERIES = (
    "north_m",
    "east_m",
    "altitude_m",
    "course_deg",
    "heading_deg",
    "bank_deg",
    "ground_speed_m_s",
    "airspeed_m_s",
    "wind_north_m_s",
    "wind_east_m_s",
    "along_m",
    "across_m",
    "slot_north_m",
    "slot_east_m",
    "slot_altitude_m",
    "mode",
    "age_s",
)
"""The numbers of a vehicle in a sample, by the names that the replay has for them."""

COLUMNS = {name: number for number, name in enumerate(SERIES)}

FLOWN_AS = COLUMNS["along_m"]
"""The series before this one are of the vehicle alone."""

CONSOLE_KINDS = {**KINDS, **SLOT_KINDS, "age_s": Kind(unit=0.01, bits=16)}
"""How they are written."""
