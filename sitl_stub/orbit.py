"""Loitering around a point: a course for every place, by a vector field."""

import math
from dataclasses import dataclass

from sitl_stub.aircraft import PlantParameters
from sitl_stub.angles import wrap_to_pi
from sitl_stub.earth import radii_m
from sitl_stub.lagging_plant import CENTIDEGREE_RAD
from sitl_stub.loops import GRAVITY_M_S2

FIELD_GAIN = 2.0
"""Of the field around the circle, in parts of 1 / radius."""


@dataclass(frozen=True, slots=True)
class Orbit:
    """A circle to fly."""

    latitude_rad: float
    """Geodetic latitude of its centre."""

    longitude_rad: float
    """Longitude of its centre."""

    radius_m: float
    """Above zero."""

    clockwise: bool = True
    """Seen from above."""

    def course_rad(self, latitude_rad: float, longitude_rad: float, *, lead_rad: float) -> float:
        """Course over ground from here: to the circle, then along it.

        chi = beta + s (pi/2 + atan(k (d - R)) + lead), beta and d bearing and distance of the aircraft
        from the centre, s = 1 clockwise (Nelson et al., Vector Field Path Following, 2007). The lead
        makes up for the lag with which a course is followed on a circle.
        """
        meridian_m, transverse_m = radii_m(self.latitude_rad)
        north_m = (latitude_rad - self.latitude_rad) * meridian_m
        east_m = wrap_to_pi(longitude_rad - self.longitude_rad)
        east_m *= transverse_m * math.cos(self.latitude_rad)
        outside_m = math.hypot(north_m, east_m) - self.radius_m
        inward_rad = math.atan(FIELD_GAIN / self.radius_m * outside_m)
        sense = 1.0 if self.clockwise else -1.0
        # The lead belongs to the circle itself: on the way to it nothing turns.
        led_rad = lead_rad * math.cos(inward_rad)
        return math.atan2(east_m, north_m) + sense * (0.5 * math.pi + inward_rad + led_rad)


def orbit_lead_rad(plant: PlantParameters, airspeed_m_s: float, radius_m: float) -> float:
    """How far ahead of the course a command has to be for the turn of a circle, in calm air.

    First order: (V / R) / alpha. `bank`: the turn's bank over GUIDED_P.
    """
    if plant.banks:
        turning_m_s2 = airspeed_m_s * airspeed_m_s / (radius_m * plant.turn_efficiency)
        bank_rad = min(math.atan(turning_m_s2 / GRAVITY_M_S2), plant.max_bank_rad)
        return min(1.0, bank_rad / (plant.guided_p_cdeg_rad * CENTIDEGREE_RAD))
    return min(1.0, airspeed_m_s / radius_m / plant.alpha_1_s)
