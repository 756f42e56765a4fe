"""The operator of a rehearsal: gives the orders of the mission's time table, as bytes over the link."""

from collections.abc import Iterator

from vfguide.formation.arrangement import Manoeuvre
from vfguide.link.order_codec import encode_order
from vfguide.mission.model import Mission
from vfguide.mission.order_plan import timetable

OPERATOR = "operator"
"""Who the sender of orders is on the links of a rehearsal."""

LEAD_S = 4.0
"""An order is given this long before its time ..."""

REPEAT_S = 0.5
"""... and again after each of these, since a link may lose it ..."""

TIMES = 6
"""... so often in all."""


_newest: list[tuple[Mission, tuple[tuple[float, bytes], ...]]] = []


def order_mail(mission: Mission) -> tuple[tuple[float, bytes], ...]:
    """(when in s, what) of all orders of a mission's time table, in the order of their times."""
    if not mission.orders:
        return ()
    # A hundred aircraft ask for those of one mission.
    if not (_newest and _newest[0][0] is mission):
        _newest[:] = [(mission, tuple(sorted(_mail(mission))))]
    return _newest[0][1]


def _mail(mission: Mission) -> Iterator[tuple[float, bytes]]:
    for arrangement, _ in timetable(mission):
        data = encode_order(arrangement)
        # What is called off is flown as soon as it is heard.
        lead_s = 0.0 if arrangement.flown is Manoeuvre.ABORT else LEAD_S
        for number in range(TIMES):
            yield arrangement.time_s - lead_s + REPEAT_S * number, data
