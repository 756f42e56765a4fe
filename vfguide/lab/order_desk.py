"""What an operator's program hears on the link of a formation, and when it has heard enough to order."""

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
from vfguide.link.opening import (
    Link,
    WatchedFormation,
    check_connected,
    open_link,
    watching_member,
)
from vfguide.link.order_codec import (
    Reply,
    Verdict,
    decode_order,
    decode_reply,
    encode_reply,
)
from vfguide.mission.model import Mission
from vfguide.mission.order_plan import LeaderPlace, formation_of_mission
from vfguide.state import HeardState

LISTEN_S = 6.0
"""So long an operator's program waits until the leader and the formation's time are known."""


KNOWS_S = 8.0
"""So long it asks for the order that is flown, if one is."""


REPEAT_S = 0.5
"""Interval of the copies of an order, until it is flown or refused."""


CLOCK_LOOK_S = 0.1
"""Interval at which the clock is looked at."""


HEARD_S = 10.0
"""What was heard longer ago says nothing of now: a desk may stay open from one flight to the next."""


MOST_KNOWN = 8
"""Orders that a desk remembers."""


class OrderDesk:
    """What an operator's program hears and says."""

    member: Member
    """As which it speaks."""

    def __init__(self, mission: Mission, *, clock: Callable[[], float] = time.monotonic) -> None:
        """Begin with nothing heard of the formation of a mission; the clock (s) tells what is old."""
        self._mission = mission
        self._clock = clock
        origin = mission.origin
        self._frame = LocalFrame(origin.latitude_deg, origin.longitude_deg, origin.altitude_amsl_m)
        self._states: dict[str, tuple[float, HeardState]] = {}
        self._may_lead = (mission.leader.vehicle, *mission.deputies)
        self._lead: tuple[float, HeardState] | None = None
        self._known: dict[int, Arrangement] = {}
        self.replies: dict[str, Reply] = {}
        """Newest answers to the order that is given."""
        self.given: tuple[int, int] | None = None
        """Number and CRC-32 of the order."""
        self.awaited: frozenset[str] = frozenset()
        """Vehicles whose answers to it count."""

    @property
    def time_s(self) -> float:
        """Time on the formation's clock, s; NaN while not known."""
        return self.member.formation_time()

    def heard_state(self, vehicle: str, data: bytes) -> None:
        """Take a vehicle's state."""
        try:
            self._states[vehicle] = self._clock(), motion_of(data, self._frame)
        except LinkDataError:
            return

    def heard_lead(self, vehicle: str, data: bytes) -> bool:
        """Take a state of the leader by which a vehicle leads in its place; whether it does lead."""
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
        """Newest state of each vehicle that is heard, times on the formation's clock."""
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
        """How the leader moves by which all fly; None while none is heard."""
        return self._fresh_lead or self.states.get(self._mission.leader.vehicle)

    @property
    def leads(self) -> str:
        """Name of the vehicle that leads, as far as is known."""
        lead = self._fresh_lead
        return holder_of(0 if lead is None else lead.term, self._may_lead)

    @property
    def flown(self) -> Arrangement | None:
        """The order that is flown; None where there is none, or where it was not heard."""
        return self._known.get(self.newest_number)

    @property
    def is_ready(self) -> bool:
        """Whether the formation is heard: its leader, or of one without a companion a follower."""
        return self.leader is not None or (self._mission.leader.is_foreign and bool(self.states))

    def awaited_from(self, formation: Formation, order: Arrangement) -> set[str]:
        """Vehicles whose answers count; not of a leader that another has succeeded and that is silent."""
        succeeded = self._fresh_lead is not None and formation.leader not in self.states
        succeeded = succeeded or self._mission.leader.is_foreign
        leaders = {order.lead, "" if succeeded else formation.leader} - {""}
        return {*formation.slots, *order.vehicles, *leaders}

    def heard_order(self, data: bytes, sealed: bytes, repeated: bool) -> None:
        """Take an order that another gives, or a vehicle repeats."""
        del sealed, repeated
        try:
            order = decode_order(data)
        except LinkDataError:
            return
        self.note_order(order)

    def note_order(self, order: Arrangement) -> None:
        """Remember an order: it is the one that is flown once the vehicles say its number."""
        # Of two orders of one number the one counts that was there when it began to be flown.
        if order.number in self._known and order.number == self.newest_number:
            return
        self._known[order.number] = order
        flown = self.newest_number
        while len(self._known) > MOST_KNOWN:
            del self._known[min(number for number in self._known if number != flown)]

    def heard_reply(self, vehicle: str, data: bytes) -> None:
        """Take a vehicle's answer."""
        try:
            reply = decode_reply(data)
        except LinkDataError:
            return
        if (reply.number, reply.check) == self.given and reply.verdict is not Verdict.UNKNOWN:
            self.replies[vehicle] = reply

    @property
    def newest_number(self) -> int:
        """Number of the order that is flown, by the vehicles' states."""
        numbers = {name: state.arrangement for name, state in self.states.items()}
        foreign = self._mission.leader.is_foreign
        return agreed_number(numbers, self._mission.timekeeper if foreign else self.leads)

    def formation(self) -> Formation:
        """As it is.

        Raises:
            VfguideError: the order that is flown is not known.
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
        # Who leads may have changed since then, and is heard.
        return replace(first.after(flown), holder=self.leads)

    def leader_place(self, time_s: float) -> LeaderPlace | None:
        """Where the leader is at a time of the formation's clock (s), if it flies and climbs straight on."""
        state = self.leader
        return None if state is None else place_after(state, time_s - state.time_s)

    def places(self) -> dict[str, LeaderPlace]:
        """Where each vehicle was that was heard."""
        return {name: place_after(state, 0.0) for name, state in self.states.items()}


def place_after(state: HeardState, seconds: float) -> LeaderPlace:
    """Where a vehicle is some seconds after a state, if it flies and climbs straight on."""
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
    """An operator's program on the links, for as long as the context lasts."""
    desk = OrderDesk(mission)
    desk.member = watching_member(
        watched,
        random,
        neighbours=list(mission.followers_by_name),
        # Orders are given by what is proven to be of now.
        watches=False,
        receive=partial(desk.heard_state, watched.leader),
        receive_neighbour=desk.heard_state,
        receive_lead=desk.heard_lead,
        # Who wants presences says none about itself.
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
    """Wait until the formation's time is known and, but to call everything off, its leader.

    Raises:
        VfguideError: they are not heard.
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
    """Wait until the formation is heard and, but to call everything off, the order that is flown is known.

    Raises:
        VfguideError: the formation is not heard.
    """
    await await_formation(desk, calls_off=calls_off)
    if not calls_off:
        # The others say where they are every half second at least.
        await asyncio.sleep(1.0)
        await await_order(desk, link)


async def await_rest(desk: OrderDesk, link: Link) -> None:
    """Wait until the slots will be at rest when an order begins that is given now: earlier it is refused."""
    while (flown := desk.flown) is not None:
        if desk.time_s + link.order_lead_s >= flown.time_s + flown.duration_s:
            return
        await asyncio.sleep(CLOCK_LOOK_S)


def unanswered(counters: Counter[str]) -> str:
    """Why nobody may have answered, by what has arrived and was not believed, and the remedy."""
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
    """Ask for the order that is flown, if one is and it is not known, until it is or nobody answers."""
    loop = asyncio.get_running_loop()
    began = loop.time()
    while desk.newest_number and desk.flown is None and loop.time() - began <= KNOWS_S:
        ask_for_order(link)
        await asyncio.sleep(REPEAT_S)


def ask_for_order(link: Link) -> None:
    """Have the vehicles repeat the order that they fly by."""
    link.say(Kind.REPLY, encode_reply(Reply(number=0, verdict=Verdict.UNKNOWN)))
