"""Orders that a ground station requests of this companion, by a MAVLink command that any of them can send.

MAV_CMD_USER_1 to the companion's own component: param1 says which order, param2 to param4 the spacing, the
vehicles by their MAVLink systems, or a slot. Nothing in MAVLink shows who has sent it, unless the connection
is signed. So a companion hears it only where it was told to and has an operator's key; what is requested is
worked out here, signed by an operator's key, and agreed on by all, as any order. It is not rehearsed.
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
"""Codes: of the shapes in their order, of the spacing alone, of paths and of who may lead."""

FOLLOWER_ORDERS = {4: "join", 5: "leave", 6: "swap", 7: "slot"}
"""Codes of orders for followers that param2 names by its MAVLink system."""

AGAIN_S = 10.0
"""A ground station that hears no answer sends a command again; so long it is the same one."""

SPACINGS_M = (1.0, 1000.0)

FARTHEST_SLOT_M = 5000.0
"""A slot that is farther off is a slip of the keys."""


def order_codes(mission: Mission) -> dict[int, Order]:
    """What each code orders in a mission; the order of a spacing says none yet."""
    codes = {1: ABORT, 2: Order(action="hold"), 3: Order(action="resume"), SPACING: Order()}
    codes |= {FIRST_SHAPE + index: Order(shape=shape) for index, shape in enumerate(SHAPES)}
    paths = mission.paths_by_name if mission.paths else ()
    codes |= {FIRST_PATH + index: Order(path=name) for index, name in enumerate(paths)}
    may_lead = (mission.leader.vehicle, *mission.deputies) if mission.deputies else ()
    return codes | {FIRST_LEADER + index: Order(lead=name) for index, name in enumerate(may_lead)}


def ground_orders_of(mission: Mission) -> "GroundOrders":
    """What ground stations may order of a mission's formation."""
    systems = {mission.vehicles[name].system_id: name for name in mission.followers_by_name}
    return GroundOrders(order_codes(mission), systems)


class GroundOrders:
    """Requests of one companion's ground stations: answered at once, and handed on."""

    def __init__(self, codes: Mapping[int, Order], followers: Mapping[int, str]) -> None:
        """Know what each code orders, and the followers by their systems; nothing was requested yet."""
        self._codes = codes
        self._followers = followers
        self._last: tuple[object, ...] | None = None
        self._last_s = -math.inf
        self._answer = 0
        self._under_way: list[Order] = []

    def take(self, request: OrderRequest, now: float) -> tuple[list[MAVLink_message], Order | None]:
        """Take a request.

        Returns:
            The answer to it, and the order that is to be given; None where there is none.
        """
        same = (request.sender, request.code, request.values)
        if request.confirmation > 0 and same == self._last and now - self._last_s < AGAIN_S:
            return [answer(request, self._answer)], None
        self._last, self._last_s = same, now
        self._answer, order = self._decide(request)
        return [answer(request, self._answer)], order

    def finish(self, order: Order) -> None:
        """Note that an order has been given, or could not be: the next may come."""
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
        # What calls everything off waits for nothing but another of its kind.
        if ABORT in self._under_way if order == ABORT else self._under_way:
            return mavlink.MAV_RESULT_TEMPORARILY_REJECTED, None
        if order is None:
            return mavlink.MAV_RESULT_DENIED, None
        self._under_way.append(order)
        return mavlink.MAV_RESULT_ACCEPTED, order

    def _for_followers(self, what: str, values: tuple[float, float, float]) -> Order | None:
        """An order for the follower of the first number; None where the numbers do not fit."""
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
        """The follower with this MAVLink system."""
        return self._followers.get(int(system)) if system == int(system) else None


def with_spacing(order: Order, values: tuple[float, float, float]) -> Order | None:
    """An order with the spacing of a request; None where the numbers do not fit."""
    spacing, *rest = values
    if rest != [0.0, 0.0]:
        return None
    if spacing == 0.0 and order != Order():
        return order
    spaced = order == Order() or order.shape is not None
    within = SPACINGS_M[0] <= spacing <= SPACINGS_M[1]
    return replace(order, spacing=spacing) if spaced and within else None


def answer(request: OrderRequest, result: int) -> MAVLink_message:
    """COMMAND_ACK to who has sent a request."""
    return mavlink.MAVLink_command_ack_message(
        mavlink.MAV_CMD_USER_1, result, 0, 0, *request.sender
    )


class FlownFormation(msgspec.Struct, frozen=True, kw_only=True):
    """What a companion knows of the formation that it flies in."""

    number: int
    """Number of the newest order that anybody flies by."""
    flown: Arrangement | None
    """What is flown; None for the slots of the mission."""
    holder: str
    """Who leads; empty for the mission's leader."""
    leader: LeaderPlace | None
    """Where the leader will be when an order begins; None where it is not heard."""


class OrderGiver(msgspec.Struct, frozen=True):
    """Works out orders of one mission, as the operator whose key it has."""

    mission: Mission
    """The mission that is flown."""
    operator: Trust
    """What signs the orders."""

    def resolved(
        self, order: Order, known: FlownFormation, *, number: int, time_s: float
    ) -> Arrangement:
        """The arrangement that an order comes to.

        Args:
            order: what is wanted.
            known: the formation as it is.
            number: of the arrangement.
            time_s: when it begins, s on the formation's clock.

        Raises:
            RefusedOrderError: it cannot be carried out; one sentence says why.
        """
        formation = formation_of_mission(self.mission)
        if known.flown is not None:
            formation = formation.after(known.flown)
        formation = replace(formation, holder=known.holder)
        found, _ = resolve(
            self.mission, order, formation, number=number, time_s=time_s, leader=known.leader
        )
        return found
