"""Whether a vehicle slips, where its mission leaves that to be found out: words for the pilot, and a plan."""

import math

from vfguide.companion.plan import FlightPlan, turning
from vfguide.guidance.turn_efficiency import TurnEfficiency

STEP = 0.02
"""A turn efficiency that differs by less from the one that is flown by changes nothing."""

UNHEARD_S = 20.0
"""After so long without a bank the pilot hears that there is none."""

UNHEARD = (
    "no ATTITUDE is heard, so that slips: auto cannot find out: flown as a vehicle that slips; see that the"
    " autopilot sends it, or write slips: true or false"
)


class SlipFinder:
    """Looks at what was learned in flight."""

    def __init__(self) -> None:
        self._flown: float | None = None
        self._said: bool | None = None
        self._since = math.inf
        self._complained = False

    def step(
        self, plan: FlightPlan, known: TurnEfficiency, now: float, *, bank_heard: bool
    ) -> tuple[str | None, FlightPlan | None]:
        """(words for the pilot, another plan), each None where there is nothing new.

        Args:
            plan: that is flown by.
            known: what was learned of its turns.
            now: s.
            bank_heard: whether the autopilot has ever told a bank.
        """
        if not plan.finds_slip or plan.asks_response:
            return None, None
        if not known.is_known:
            return self._unheard(now, heard=bank_heard), None
        slips = known.slips(before=plan.slips)
        moved = self._flown is None or abs(known.value - self._flown) >= STEP
        if slips is plan.slips and not moved:
            return None, None
        self._flown = known.value
        words = None if slips is self._said else slip_sentence(known.value, slips=slips)
        self._said = slips
        found = turning(plan, known.value, slips=slips)
        return words, None if found == plan else found

    def _unheard(self, now: float, *, heard: bool) -> str | None:
        """The word that nothing can be learned, once."""
        self._since = min(self._since, now)
        if heard or self._complained or now - self._since < UNHEARD_S:
            return None
        self._complained = True
        return UNHEARD


def slip_sentence(efficiency: float, *, slips: bool) -> str:
    """What was found, for the pilot."""
    found = f"it turns {efficiency:.2f} of what its bank says"
    if slips:
        return f"{found}: flown as a vehicle that slips; nothing to do"
    return f"{found}: it does not slip, and is flown so; nothing to do"
