"""Operator's side of a formation's link: what it hears, and when it has heard enough to order."""

import asyncio
import math
import time
from collections import Counter
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from functools import partial
from random import Random

from msgspec.structs import replace

from vfguide.companion.roles import holder_of
from vfguide.companion.state_receiver import motion_of
from vfguide.errors import VfguideError
from vfguide.formation.arrangement import Arrangement, agreed_number
from vfguide.formation.orders import Formation
from vfguide.frames import LocalFrame
from vfguide.link.codec import Kind, LinkDataError, is_leaders
from vfguide.link.member import Member, ignore
from vfguide.link.opening import Link, WatchedFormation, check_connected, open_link, watching_member
from vfguide.link.order_codec import Reply, Verdict, decode_order, decode_reply, encode_reply
from vfguide.mission.model import Mission
from vfguide.mission.order_plan import LeaderPlace, formation_of_mission
from vfguide.state import HeardState

LISTEN_S = 6.0
"""Longest wait of an operator's program for the leader and the formation's time."""

KNOWS_S = 8.0
"""Time for which the program asks for the active order, if there is one."""

REPEAT_S = 0.5
"""Interval of the copies of an order, until it is flown or refused."""

CLOCK_LOOK_S = 0.1
"""Interval of checks of the formation's clock."""

HEARD_S = 10.0
"""Age from which a message is out of date: a desk may stay open from one flight to the next."""

MOST_KNOWN = 8
"""Largest number of orders that a desk remembers."""


class OrderDesk:
    """Messages that an operator's program hears and sends."""

    member: Member

    def __init__(self, mission: Mission, *, clock: Callable[[], float] = time.monotonic) -> None:
        """Begin with nothing heard; the clock (s) tells the age of messages."""
        self._mission = mission
        self._clock = clock
        origin = mission.origin
        self._frame = LocalFrame(origin.latitude_deg, origin.longitude_deg, origin.altitude_amsl_m)
        self._states: dict[str, tuple[float, HeardState]] = {}
        self._may_lead = (mission.leader.vehicle, *mission.deputies)
        self._lead: tuple[float, HeardState] | None = None
        self._known: dict[int, Arrangement] = {}
        self.replies: dict[str, Reply] = {}
        """Newest answers to the order being given."""
        self.given: tuple[int, int] | None = None
        """Number and CRC-32 of the order being given."""
        self.awaited: frozenset[str] = frozenset()
        """Vehicles whose answers to the order count."""

    @property
    def time_s(self) -> float:
        """Formation time, s; NaN while unknown."""
        return self.member.formation_time()

    def heard_state(self, vehicle: str, data: bytes) -> None:
        """Store a vehicle's state."""
        try:
            self._states[vehicle] = self._clock(), motion_of(data, self._frame)
        except LinkDataError:
            return

    def heard_lead(self, vehicle: str, data: bytes) -> bool:
        """Store the leader state of a vehicle that leads as a deputy; return whether it does lead."""
        try:
            state = motion_of(data, self._frame)
        except LinkDataError:
            return False
        if not is_leaders(data) or holder_of(state.term, self._may_lead) != vehicle:
            return False
        known = self._fresh_lead
        if known is not None and state.term < known.term:
            return False
        self._lead = self._clock(), state
        return True

    @property
    def states(self) -> dict[str, HeardState]:
        """Newest states by vehicle, with formation times; states older than `HEARD_S` are left out."""
        now = self._clock()
        return {
            name: state
            for name, (heard_s, state) in self._states.items()
            if now - heard_s < HEARD_S
        }

    @property
    def _fresh_lead(self) -> HeardState | None:
        if self._lead is None or self._clock() - self._lead[0] >= HEARD_S:
            return None
        return self._lead[1]

    @property
    def leader(self) -> HeardState | None:
        """State of the leader that all follow; None while none is heard."""
        return self._fresh_lead or self.states.get(self._mission.leader.vehicle)

    @property
    def leads(self) -> str:
        """Name of the vehicle that leads, as far as known."""
        lead = self._fresh_lead
        return holder_of(0 if lead is None else lead.term, self._may_lead)

    @property
    def flown(self) -> Arrangement | None:
        """Active order; None if there is none, or if it was not heard."""
        return self._known.get(self.newest_number)

    @property
    def is_ready(self) -> bool:
        """Whether the leader is heard, or any vehicle if the leader has no companion."""
        return self.leader is not None or (self._mission.leader.is_foreign and bool(self.states))

    def awaited_from(self, formation: Formation, order: Arrangement) -> set[str]:
        """Return vehicles whose answers count: not a foreign leader, nor a silent one that was succeeded."""
        succeeded = self._fresh_lead is not None and formation.leader not in self.states
        succeeded = succeeded or self._mission.leader.is_foreign
        leaders = {order.lead, "" if succeeded else formation.leader} - {""}
        return {*formation.slots, *order.vehicles, *leaders}

    def heard_order(self, data: bytes, sealed: bytes, repeated: bool) -> None:
        """Take an order that another operator gives or a vehicle repeats."""
        del sealed, repeated
        try:
            order = decode_order(data)
        except LinkDataError:
            return
        self.note_order(order)

    def note_order(self, order: Arrangement) -> None:
        """Remember an order; it is active once the vehicles report its number."""
        # Of two orders with one number, the one known when it became active counts.
        if order.number in self._known and order.number == self.newest_number:
            return
        self._known[order.number] = order
        flown = self.newest_number
        while len(self._known) > MOST_KNOWN:
            del self._known[min(number for number in self._known if number != flown)]

    def heard_reply(self, vehicle: str, data: bytes) -> None:
        """Store a vehicle's answer if it is to the order being given."""
        try:
            reply = decode_reply(data)
        except LinkDataError:
            return
        if (reply.number, reply.check) == self.given and reply.verdict is not Verdict.UNKNOWN:
            self.replies[vehicle] = reply

    @property
    def newest_number(self) -> int:
        """Number of the active order, from the vehicles' states."""
        numbers = {name: state.arrangement for name, state in self.states.items()}
        foreign = self._mission.leader.is_foreign
        return agreed_number(numbers, self._mission.timekeeper if foreign else self.leads)

    def formation(self) -> Formation:
        """Return the formation as it is now.

        Raises:
            VfguideError: the active order is not known.
        """
        first = replace(formation_of_mission(self._mission), holder=self.leads)
        number = self.newest_number
        if number == 0:
            return first
        flown = self.flown
        if flown is None:
            raise VfguideError(
                f"order {number} is flown, and no vehicle has repeated it: see that their companions run"
            )
        # The lead may have changed since the order; the current one is heard.
        return replace(first.after(flown), holder=self.leads)

    def leader_place(self, time_s: float) -> LeaderPlace | None:
        """Return the leader's place at a formation time, extrapolated straight ahead at its climb rate."""
        state = self.leader
        return None if state is None else place_after(state, time_s - state.time_s)

    def places(self) -> dict[str, LeaderPlace]:
        """Return the last place of each vehicle heard."""
        return {name: place_after(state, 0.0) for name, state in self.states.items()}


def place_after(state: HeardState, seconds: float) -> LeaderPlace:
    """Return a vehicle's place some seconds after a state, extrapolated straight ahead at its climb rate."""
    run = state.ground_speed * seconds
    return LeaderPlace(
        state.north + run * math.cos(state.course),
        state.east + run * math.sin(state.course),
        state.course,
        height=state.height + state.climb_rate * seconds,
        climb_rate=state.climb_rate,
    )


@asynccontextmanager
async def at_desk(
    mission: Mission, watched: WatchedFormation, random: Random
) -> AsyncIterator[tuple[OrderDesk, Link]]:
    """Run an operator's desk on the links for as long as the context lasts."""
    desk = OrderDesk(mission)
    desk.member = watching_member(
        watched,
        random,
        neighbours=list(mission.followers_by_name),
        # Orders need states that are proven to be current.
        watches=False,
        receive=partial(desk.heard_state, watched.leader),
        receive_neighbour=desk.heard_state,
        receive_lead=desk.heard_lead,
        # A listener announces no presence of its own.
        receive_presence=ignore,
        receive_order=desk.heard_order,
        receive_reply=desk.heard_reply,
    )
    async with open_link(
        watched.addresses, formation=watched.formation, member=desk.member, random=random
    ) as link:
        await link.settle()
        check_connected(link)
        yield desk, link


async def await_formation(desk: OrderDesk, *, calls_off: bool) -> None:
    """Wait for the formation's time and, unless everything is called off, for its leader.

    Raises:
        VfguideError: nothing is heard in time.
    """
    loop = asyncio.get_running_loop()
    began = loop.time()
    while not ((calls_off or desk.is_ready) and math.isfinite(desk.time_s)):
        if loop.time() - began > LISTEN_S:
            raise VfguideError(
                f"neither the leader {desk.member.trust.leader!r} nor a deputy in its place answers:"
                f" {unanswered(desk.member.counters)}"
            )
        await asyncio.sleep(0.05)


async def await_present(desk: OrderDesk, link: Link, *, calls_off: bool) -> None:
    """Wait for the formation and, unless everything is called off, for its active order.

    Raises:
        VfguideError: the formation is not heard.
    """
    await await_formation(desk, calls_off=calls_off)
    if not calls_off:
        # The other vehicles send their states at least every half second.
        await asyncio.sleep(1.0)
        await await_order(desk, link)


async def await_rest(desk: OrderDesk, link: Link) -> None:
    """Wait until an order given now would begin with all slots at rest; an earlier one is refused."""
    while (flown := desk.flown) is not None:
        if desk.time_s + link.order_lead_s >= flown.time_s + flown.duration_s:
            return
        await asyncio.sleep(CLOCK_LOOK_S)


def unanswered(counters: Counter[str]) -> str:
    """Return the likely reason for silence, from the messages that were refused, and the remedy."""
    refused = {
        reason.removeprefix("refused: "): count
        for reason, count in counters.most_common()
        if reason.startswith("refused: ")
    }
    if not refused:
        return "nothing arrives; see that its companion runs, and that --link is the formation's"
    reason = next(iter(refused))
    return (
        f"{sum(refused.values())} messages arrived that are not believed, most for {reason!r}; use the roster"
        " and the keys that the companions use"
    )


async def await_order(desk: OrderDesk, link: Link) -> None:
    """Ask for the active order until it is known or `KNOWS_S` have passed."""
    loop = asyncio.get_running_loop()
    began = loop.time()
    while desk.newest_number and desk.flown is None and loop.time() - began <= KNOWS_S:
        ask_for_order(link)
        await asyncio.sleep(REPEAT_S)


def ask_for_order(link: Link) -> None:
    """Ask the vehicles to repeat their active order."""
    link.say(Kind.REPLY, encode_reply(Reply(number=0, verdict=Verdict.UNKNOWN)))
