"""A ground station beside a companion: orders by MAVLink commands, the connection both share, signatures."""

import asyncio
from collections.abc import Callable
from unittest.mock import Mock

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from sitl_stub import Autopilot, CalmWind, Signing
from tests.kit.companion import (
    KINDS,
    MANUAL,
    Flight,
    companion_of,
    emulator,
    leader_bytes,
    new_flight,
)
from tests.kit.link import LEADER, Wire, trust_of
from tests.kit.missions import replaced
from tests.kit.wire import command_long, heartbeat, of_type, packed, parsed, types_of
from vfguide.companion.daemon import Daemon, Surroundings
from vfguide.companion.ground_orders import (
    ABORT,
    FlownFormation,
    OrderGiver,
    ground_orders_of,
    order_codes,
)
from vfguide.companion.mission_plan import adapter_of, flight_plan
from vfguide.companion.supervisor import Mode
from vfguide.formation.arrangement import Arrangement, Manoeuvre, Point
from vfguide.formation.orders import Order
from vfguide.formation.transition import RefusedOrderError
from vfguide.link.order_codec import decode_order
from vfguide.link.trust import RefusedError
from vfguide.mavlink.address import parse_address
from vfguide.mavlink.framing import ConnectionSigning
from vfguide.mavlink.reports import OrderRequest

USER_1, USER_2 = 31_010, 31_011
ACCEPTED, TEMPORARILY_REJECTED, DENIED, UNSUPPORTED = 0, 1, 2, 3
STATION = (255, 190)
KEY = bytes(range(32))
SURVEY = {"type": "circle", "centre": {}, "radius_m": 300.0, "direction": "clockwise"}
MISSION = replaced("shapes", paths={"survey": SURVEY}, deputies=["f2", "f1"])
"""One with another path, and deputies."""


def command(
    code: float,
    *values: float,
    number: int = USER_1,
    target: tuple[int, int] = (2, 191),
    confirmation: int = 0,
    key: bytes | None = None,
) -> bytes:
    """COMMAND_LONG as a ground station sends it."""
    station = mavlink.MAVLink(None, srcSystem=STATION[0], srcComponent=STATION[1])
    if key is not None:
        ConnectionSigning(key, lambda: 1.8e9).prepare(station)
    message = command_long(number, code, *values, system_id=target[0], component_id=target[1])
    message.confirmation = confirmation
    return bytes(message.pack(station))


def heard(
    *datagrams: bytes, takes_orders: bool = True, key: bytes | None = None
) -> tuple[list[MAVLink_message], list[Order]]:
    """What f1's companion answers to bytes, and which orders it hands on."""
    companion = companion_of(
        engage=False,
        signing=None if key is None else ConnectionSigning(key, lambda: 1.8e9),
        ground_orders=ground_orders_of(MISSION) if takes_orders else None,
    )
    answers, requested = [], []
    for number, datagram in enumerate(datagrams):
        out = companion.receive_mavlink(datagram, 1.0 + 0.1 * number)
        answers += of_type(parsed(out.to_autopilot), "COMMAND_ACK")
        requested += out.requested
    return answers, requested


def test_each_code_is_one_order():
    shapes = ("vee", "echelon-left", "echelon-right", "line-abreast", "trail", "diamond")
    assert order_codes(MISSION) == {
        1: ABORT,
        2: Order(action="hold"),
        3: Order(action="resume"),
        20: Order(),
        **{10 + n: Order(shape=shape) for n, shape in enumerate((*shapes, "finger-four"))},
        **{30 + n: Order(path=path) for n, path in enumerate(("main", "survey"))},
        **{60 + n: Order(lead=lead) for n, lead in enumerate(("leader", "f2", "f1"))},
    }


@pytest.mark.parametrize(
    ("code", "values", "order"),
    [
        (4, (4,), Order(join=("f3",))),
        (5, (2,), Order(leave=("f1",))),
        (6, (2, 4), Order(swap=("f1", "f3"))),
        (7, (3, -20.5, 40), Order(slots={"f2": Point(-20.5, 40.0)})),
        (10, (30,), Order(shape="vee", spacing=30.0)),
        (14, (), Order(shape="trail")),
        (20, (25.5,), Order(spacing=25.5)),
        (1, (), ABORT),
        (31, (), Order(path="survey")),
    ],
)
def test_a_request_is_accepted_and_handed_on_as_an_order(code, values, order):
    answers, requested = heard(command(code, *values))
    assert requested == [order]
    (answer,) = answers
    assert (answer.command, answer.result) == (USER_1, ACCEPTED)
    # Routers send it where it belongs.
    assert (answer.target_system, answer.target_component) == STATION
    assert (answer.get_srcSystem(), answer.get_srcComponent()) == (2, 191)


@pytest.mark.parametrize(
    ("code", "values", "result"),
    [
        *((code, (), UNSUPPORTED) for code in (99, 10.5)),
        *((code, (), DENIED) for code in (20, 4)),
        *((10, values, DENIED) for values in ((2000.0,), (-5.0,), (30.0, 1.0))),
        # The leader has no slot.
        (4, (1,), DENIED),
        (2, (30.0,), DENIED),
        *((5, values, DENIED) for values in ((2.5,), (2, 3))),
        *((6, values, DENIED) for values in ((2,), (2, 2), (2, 3, 4))),
        (7, (2, 1e6, 0), DENIED),
    ],
)
def test_what_is_no_order_is_refused(code, values, result):
    answers, requested = heard(command(code, *values))
    assert [one.result for one in answers] == [result]
    assert requested == []


def test_a_companion_that_was_not_told_to_hears_no_requests():
    assert heard(command(1), takes_orders=False) == ([], [])


@pytest.mark.parametrize(
    "data",
    [
        *(command(1, target=target) for target in ((3, 191), (2, 1), (2, 0), (0, 191))),
        *(command(1, number=USER_2), command(float("nan")), command(1)[:-1] + b"\x00"),
    ],
)
def test_what_is_for_another_or_for_all_or_damaged_is_passed_over(data):
    assert heard(data) == ([], [])


def test_on_a_signed_connection_only_who_has_the_key_requests_orders():
    assert heard(command(1), key=KEY) == ([], [])
    assert heard(command(1, key=bytes(32)), key=KEY) == ([], [])
    answers, requested = heard(command(1, key=KEY), key=KEY)
    assert [one.result for one in answers] == [ACCEPTED]
    assert requested == [ABORT]


def test_a_command_that_is_sent_again_is_answered_again_and_not_given_twice():
    answers, requested = heard(command(2), command(2, confirmation=1), command(2, confirmation=2))
    assert [one.result for one in answers] == [ACCEPTED] * 3
    assert requested == [Order(action="hold")]


def test_one_order_is_given_at_a_time_and_what_calls_everything_off_does_not_wait():
    answers, requested = heard(command(2), command(10), command(1), command(1))
    assert [one.result for one in answers] == [ACCEPTED, TEMPORARILY_REJECTED] * 2
    assert requested == [Order(action="hold"), ABORT]


NUMBERS = st.floats(width=32, allow_nan=False, allow_infinity=False) | st.integers(0, 9).map(float)


def request_of(code: float, values: tuple[float, ...] = (0.0,) * 3, again: int = 0) -> OrderRequest:
    return OrderRequest(sender=STATION, code=code, values=values, confirmation=again)


@given(st.lists(st.tuples(NUMBERS, st.tuples(NUMBERS, NUMBERS, NUMBERS), st.integers(0, 255))))
def test_whatever_numbers_come_no_more_than_two_orders_are_under_way(numbers):
    requests = ground_orders_of(MISSION)
    handed_on = []
    for now, asked in enumerate(numbers):
        answers, words = requests.take(request_of(*asked), float(now))
        assert len(answers) == 1
        handed_on += [] if words is None else [words]
    assert len(handed_on) <= 2


def test_the_next_order_is_accepted_once_one_is_given():
    requests = ground_orders_of(MISSION)
    assert requests.take(request_of(2.0), 1.0)[1] == Order(action="hold")
    requests.finish(Order(action="hold"))
    assert requests.take(request_of(3.0), 2.0)[1] == Order(action="resume")


def test_an_order_is_worked_out_from_the_formation_as_it_is():
    giver = OrderGiver(MISSION, trust_of("eye", 9))
    flown = FlownFormation(number=0, flown=None, holder="leader", leader=None)
    trail = giver.resolved(Order(shape="trail"), flown, number=8, time_s=60.0)
    assert (trail.number, trail.time_s) == (8, 60.0)
    later = replace(flown, number=8, flown=trail)
    swapped = giver.resolved(Order(swap=("f1", "f2")), later, number=9, time_s=90.0)
    first, second = trail.place_of("f1"), swapped.place_of("f2")
    assert first is not None
    assert second is not None
    assert second.end == first.end
    with pytest.raises(RefusedOrderError, match="leads already"):
        giver.resolved(Order(lead="leader"), later, number=9, time_s=90.0)


def test_it_is_signed_by_the_operator_and_heard_by_all_and_by_the_companion_that_gives_it():
    wire = Wire()
    leader, one, other = (
        wire.station(name, session=number) for number, name in enumerate((LEADER, "f1", "f2"), 1)
    )
    with pytest.raises(RefusedError, match="has not answered yet"):
        one.member.give(trust_of("eye", 9), b"vee")
    wire.fly(leader, 2.0, one, other)
    operator = trust_of("eye", 9)
    for giver in (one, leader):
        giver.member.give(operator, b"vee")
        wire.run(0.1)
    heard = [station.orders for station in (leader, one, other)]
    assert [[order for order, *_ in orders] for orders in heard] == [[b"vee", b"vee"]] * 3
    # A vehicle's own key gives none.
    one.member.give(trust_of("f1", 10), b"vee")
    wire.run(0.1)
    assert len(other.orders) == 2
    assert other.counters["refused: not for its sender to say"] == 1


class WaitedClock:
    """A clock that runs only while somebody waits."""

    def __init__(self) -> None:
        self._now_s = 10.0

    def now(self) -> float:
        return self._now_s

    def real_seconds(self, seconds: float) -> float:
        self._now_s += seconds
        return 0.0


class Giving:
    """The leader's daemon without sockets, whose followers fly by order 7, which it has missed or not."""

    def __init__(self, *, misses: bool, resolves: Callable[..., Arrangement] | None = None) -> None:
        giver = OrderGiver(MISSION, trust_of("eye", 9))
        self.daemon = Daemon(
            flight_plan(MISSION, "leader"),
            adapter_of(MISSION.vehicles["leader"]),
            Surroundings(
                mavlink=parse_address("udpin://127.0.0.1:14540"),
                links=(),
                formation=MISSION.name,
                trust=trust_of("leader", 1),
                clock=WaitedClock(),
                engage=False,
                record=None,
                order_giver=giver if resolves is None else Mock(resolved=resolves),
                ground_orders=ground_orders_of(MISSION),
            ),
        )
        self.given: list[bytes] = []
        member = Mock(give=lambda _operator, body: self.given.append(body))
        self.daemon._own_member = member  # noqa: SLF001
        self.daemon._link = Mock(order_lead_s=2.0, counters={})  # noqa: SLF001
        for name in ("f1", "f2", "f3") if misses else ():
            state = leader_bytes(10.0, north=-40.0, arrangement=7)
            self.daemon._companion.receive_neighbour(name, state, 10.0)  # noqa: SLF001

    async def request(self, code: float, caplog: pytest.LogCaptureFixture) -> list[str]:
        """A ground station's request, until nothing is under way; returns what is told."""
        caplog.set_level("INFO")
        self.daemon._take_mavlink(command(code, target=(1, 191)))  # noqa: SLF001
        await asyncio.gather(*self.daemon._orders)  # noqa: SLF001
        return [record.message for record in caplog.records]


async def test_an_abort_is_given_though_the_companion_has_missed_an_order(caplog):
    giving = Giving(misses=True)
    await giving.request(1, caplog)
    assert {decode_order(body).flown for body in giving.given} == {Manoeuvre.ABORT}
    # Repeated every half second until 6 s after its time, which is 2 s ahead.
    assert len(giving.given) == 16


async def test_no_other_order_is_given_while_one_is_missed(caplog):
    giving = Giving(misses=True)
    (told,) = await giving.request(2, caplog)
    assert "the order cannot be given: the others fly by an order that is not known here" in told
    assert giving.given == []


async def test_an_order_that_fails_in_a_law_is_told_and_the_next_one_is_taken(caplog):
    def fails(*_: object, **__: object) -> Arrangement:
        raise ZeroDivisionError("a law's")

    giving = Giving(misses=False, resolves=fails)
    for _ in range(2):
        caplog.clear()
        told = await giving.request(1, caplog)
        assert any("cannot be given: ZeroDivisionError" in text for text in told), told


REQUEST_MESSAGE, SET_MESSAGE_INTERVAL, GET_MESSAGE_INTERVAL = 512, 511, 510


class QGroundControl:
    """What QGroundControl sends to f1, in its order; everything it hears comes by the same router."""

    def __init__(self, flown: Flight) -> None:
        self._flown = flown

    def send(self, message: MAVLink_message) -> list[MAVLink_message]:
        """Send a message; what the autopilot answers at once reaches the companion, too."""
        answer = self._flown.autopilot.receive(packed(message))
        self._flown.waiting += answer
        return parsed(answer)

    def command(self, number: int, *parameters: float) -> list[MAVLink_message]:
        return self.send(command_long(number, *parameters, system_id=2))

    def start(self) -> dict[str, set[str]]:
        """Connect to the vehicle; the types of the answers by what was asked."""
        answers = {
            "heartbeat": self.send(mavlink.MAVLink_heartbeat_message(6, 8, 192, 0, 4, 3)),
            "version": self.command(REQUEST_MESSAGE, 148),
            "protocol": self.command(REQUEST_MESSAGE, 300),
            "parameters": self.send(mavlink.MAVLink_param_request_list_message(2, 1)),
            # Older versions ask ArduPilot for streams, others for messages one by one.
            "streams": self.send(mavlink.MAVLink_request_data_stream_message(2, 1, 0, 4, 1)),
            "interval": self.command(SET_MESSAGE_INTERVAL, 33, 250_000),
            "mission": self.send(mavlink.MAVLink_mission_request_list_message(2, 1, 0)),
        }
        targets = {(one.target_system, one.target_component) for one in answers["mission"]}
        assert targets == {(255, 190)}
        return {asked: set(types_of(messages)) for asked, messages in answers.items()}

    def interval_us(self, message_id: int) -> int:
        (told,) = of_type(self.command(GET_MESSAGE_INTERVAL, message_id), "MESSAGE_INTERVAL")
        return told.interval_us


@pytest.mark.parametrize("kind", KINDS)
def test_qgroundcontrol_gets_its_answers_and_the_companion_its_rate_back(kind):
    flown = new_flight(kind=kind, until_s=20.0)
    assert flown.mode.steers
    station = QGroundControl(flown)
    before_us = station.interval_us(33)
    answers = station.start()
    assert "AUTOPILOT_VERSION" in answers["version"]
    assert "COMMAND_ACK" in answers["interval"]
    assert "MISSION_COUNT" in answers["mission"]
    # It has slowed the position down for everybody on this connection: the companion asks again.
    assert station.interval_us(33) > before_us
    flown.run(24.0)
    assert station.interval_us(33) == before_us
    flown.run(60.0)
    assert all(mode.steers for time, mode in flown.modes if time > 20.0)


def test_answers_to_the_ground_station_are_none_to_the_companion():
    flown = new_flight(until_s=20.0)
    station = QGroundControl(flown)
    # Refused: an airspeed beyond its range, a mode that it does not have.
    for _ in range(3):
        station.command(43_000, 0, 80, 0)
        station.command(176, 1, 99)
        flown.run(flown.now + 1.0)
    assert flown.told("43000", from_s=20.0) == flown.told("CHANGE_SPEED", from_s=20.0) == []
    assert flown.mode.steers


NOW_S = 1_800_000_000.0


def signed_flight(key: bytes | None) -> Flight:
    """Fly a leader whose autopilot has signed the connection to its companion."""
    flown = new_flight("leader", link=lambda _now: [])
    config = emulator(system_id=1, north=0.0, east=0.0).config

    def unix_time() -> float:
        return NOW_S + flown.now

    flown.autopilot = Autopilot(config, CalmWind(), signing=Signing(KEY), unix_time=unix_time)
    signing = None if key is None else ConnectionSigning(key, unix_time)
    flown.companion = companion_of("leader", signing=signing)
    return flown


def test_with_the_key_the_companion_is_obeyed_and_a_forged_heartbeat_takes_nothing_from_it():
    flown = signed_flight(KEY)
    flown.run(30.0)
    assert flown.state == (Mode.TRACKING, "GUIDED")
    assert flown.autopilot.counters["not signed"] == 0
    flown.run(35.0, forge=lambda _: packed(heartbeat(MANUAL), system_id=1, component_id=1))
    assert flown.mode is Mode.TRACKING


def test_without_it_nothing_that_is_said_is_obeyed():
    flown = signed_flight(None)
    flown.run(5.0)
    assert flown.autopilot_mode == "LOITER"
    assert flown.autopilot.counters["not signed"] > 0
