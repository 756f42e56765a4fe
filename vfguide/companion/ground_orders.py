"""Orders requested by ground stations of this companion, by a MAVLink command that any of them can send.

MAV_CMD_USER_1 goes to the companion's own component. param1 is the code of the order; param2 to param4 are
the spacing, the vehicles by their MAVLink systems, or a slot. Nothing in MAVLink authenticates the sender,
unless the connection is signed. So a companion accepts requests only if told to, and with an operator's key.
Like any order, a request is resolved here, signed with that key, and agreed on by all. It is not rehearsed.
"""

import math
from collections.abc import Mapping

import msgspec
from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.formation.arrangement import SHAPES, Arrangement, Point
from vfguide.formation.orders import Order
from vfguide.link.trust import Trust
from vfguide.mavlink.reports import OrderRequest
from vfguide.mission.model import Mission
from vfguide.mission.order_plan import LeaderPlace, formation_of_mission, resolve

ABORT = Order(action="abort")

FIRST_SHAPE, SPACING, FIRST_PATH, FIRST_LEADER = 10, 20, 30, 60
"""First codes: of the shapes in their order, of the spacing alone, of paths and of possible leaders."""

FOLLOWER_ORDERS = {4: "join", 5: "leave", 6: "swap", 7: "slot"}
"""Codes of orders for followers, which param2 names by MAVLink system."""

AGAIN_S = 10.0
"""Time for which a repeated command is the same one, s: ground stations repeat unanswered commands."""

SPACINGS_M = (1.0, 1000.0)

FARTHEST_SLOT_M = 5000.0
"""Greatest offset of a slot, m: a farther one is a typing error."""


def order_codes(mission: Mission) -> dict[int, Order]:
    """Return the order of each code in a mission; the one for a spacing has no spacing yet."""
    codes = {1: ABORT, 2: Order(action="hold"), 3: Order(action="resume"), SPACING: Order()}
    codes |= {FIRST_SHAPE + index: Order(shape=shape) for index, shape in enumerate(SHAPES)}
    paths = mission.paths_by_name if mission.paths else ()
    codes |= {FIRST_PATH + index: Order(path=name) for index, name in enumerate(paths)}
    may_lead = (mission.leader.vehicle, *mission.deputies) if mission.deputies else ()
    return codes | {FIRST_LEADER + index: Order(lead=name) for index, name in enumerate(may_lead)}


def ground_orders_of(mission: Mission) -> "GroundOrders":
    """Return the orders that ground stations may request of a mission's formation."""
    systems = {mission.vehicles[name].system_id: name for name in mission.followers_by_name}
    return GroundOrders(order_codes(mission), systems)


class GroundOrders:
    """Requests of one companion's ground stations, answered at once and passed on."""

    def __init__(self, codes: Mapping[int, Order], followers: Mapping[int, str]) -> None:
        self._codes = codes
        self._followers = followers
        self._last: tuple[object, ...] | None = None
        self._last_s = -math.inf
        self._answer = 0
        self._under_way: list[Order] = []

    def take(self, request: OrderRequest, now: float) -> tuple[list[MAVLink_message], Order | None]:
        """Take a request; return (answer, order to give or None)."""
        same = (request.sender, request.code, request.values)
        if request.confirmation > 0 and same == self._last and now - self._last_s < AGAIN_S:
            return [answer(request, self._answer)], None
        self._last, self._last_s = same, now
        self._answer, order = self._decide(request)
        return [answer(request, self._answer)], order

    def finish(self, order: Order) -> None:
        """Note that an order was given, or could not be, so that the next may come."""
        self._under_way.remove(order)

    def _decide(self, request: OrderRequest) -> tuple[int, Order | None]:
        if not (abs(request.code) < 1e3 and round(request.code) == request.code):
            return mavlink.MAV_RESULT_UNSUPPORTED, None
        code = round(request.code)
        if code in FOLLOWER_ORDERS:
            order = self._for_followers(FOLLOWER_ORDERS[code], request.values)
        elif code in self._codes:
            order = with_spacing(self._codes[code], request.values)
        else:
            return mavlink.MAV_RESULT_UNSUPPORTED, None
        # An abort waits for nothing but another abort.
        if ABORT in self._under_way if order == ABORT else self._under_way:
            return mavlink.MAV_RESULT_TEMPORARILY_REJECTED, None
        if order is None:
            return mavlink.MAV_RESULT_DENIED, None
        self._under_way.append(order)
        return mavlink.MAV_RESULT_ACCEPTED, order

    def _for_followers(self, what: str, values: tuple[float, float, float]) -> Order | None:
        """Return an order for the follower of the first value; None where the values do not fit."""
        system, second, third = values
        name = self._follower(system)
        if name is None:
            return None
        if what == "slot":
            near = max(abs(second), abs(third)) <= FARTHEST_SLOT_M
            return Order(slots={name: Point(second, third)}) if near else None
        if what == "swap":
            other = self._follower(second)
            if other is None or other == name or third != 0.0:
                return None
            return Order(swap=(name, other))
        if second != 0.0 or third != 0.0:
            return None
        return Order(join=(name,)) if what == "join" else Order(leave=(name,))

    def _follower(self, system: float) -> str | None:
        """Return the follower with this MAVLink system; None without one."""
        return self._followers.get(int(system)) if system == int(system) else None


def with_spacing(order: Order, values: tuple[float, float, float]) -> Order | None:
    """Return an order with the spacing of a request; None where the values do not fit."""
    spacing, *rest = values
    if rest != [0.0, 0.0]:
        return None
    if spacing == 0.0 and order != Order():
        return order
    spaced = order == Order() or order.shape is not None
    within = SPACINGS_M[0] <= spacing <= SPACINGS_M[1]
    return replace(order, spacing=spacing) if spaced and within else None


def answer(request: OrderRequest, result: int) -> MAVLink_message:
    """Return the COMMAND_ACK for the sender of a request."""
    return mavlink.MAVLink_command_ack_message(
        mavlink.MAV_CMD_USER_1, result, 0, 0, *request.sender
    )


class FlownFormation(msgspec.Struct, frozen=True, kw_only=True):
    """Formation as one companion knows it."""

    number: int
    """Number of the newest order that any vehicle flies by."""
    flown: Arrangement | None
    """Present arrangement; None for the slots of the mission."""
    holder: str
    """Present leader; empty for the mission's leader."""
    leader: LeaderPlace | None
    """Predicted place of the leader when an order begins; None if it is not heard."""


class OrderGiver(msgspec.Struct, frozen=True):
    """Resolver of orders for one mission, with an operator's key."""

    mission: Mission
    operator: Trust
    """Signs the orders."""

    def resolved(
        self, order: Order, known: FlownFormation, *, number: int, time_s: float
    ) -> Arrangement:
        """Return the arrangement that an order leads to, beginning at a time of the formation's clock, s.

        Raises:
            RefusedOrderError: the order cannot be carried out; one sentence says why.
        """
        formation = formation_of_mission(self.mission)
        if known.flown is not None:
            formation = formation.after(known.flown)
        formation = replace(formation, holder=known.holder)
        found, _ = resolve(
            self.mission, order, formation, number=number, time_s=time_s, leader=known.leader
        )
        return found
