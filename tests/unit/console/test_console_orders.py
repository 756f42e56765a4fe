"""An order from its rehearsal to what became of it, as the console's pages see it.

What the console's server makes of orders that are sent to it: whose it takes, and what it refuses.

The console in containers only looks on unless it is asked to give orders; then the broker lets it.
"""

import asyncio
import json
import os
import subprocess
from collections.abc import Awaitable, Callable, MutableMapping
from types import SimpleNamespace
from typing import Any
from unittest.mock import AsyncMock

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.kit.missions import ROOT, shipped
from vfguide.errors import VfguideError
from vfguide.formation.arrangement import Manoeuvre
from vfguide.formation.orders import Order
from vfguide.lab.console import orders
from vfguide.lab.console.orders import FRESH_S, BusyError, OrderPanel
from vfguide.lab.console.server import LARGEST_BODY, Access, AccessToken, application
from vfguide.lab.console.source import Source
from vfguide.lab.order_desk import OrderDesk
from vfguide.lab.ordering import OrderOutcome, RehearsedOrder
from vfguide.lab.studies.order import Prediction
from vfguide.link.order_codec import Reply, Verdict
from vfguide.mission import Mission
from vfguide.mission.order_plan import formation_of_mission, resolve

VEE = Order(shape="vee", spacing=30.0)


class Air:
    """In the place of rehearsals and aircraft: what they would say, and how long they take."""

    def __init__(self, mission: Mission, patch: pytest.MonkeyPatch) -> None:
        self.mission = mission
        self.now = 0.0
        self.refusal: str | None = None
        self.waits = asyncio.Event()
        self.waits.set()
        self.verdicts = dict.fromkeys(("leader", "f1", "f2", "f3"), Verdict.FLOWN)
        self.given: list[Manoeuvre] = []
        self.desk = OrderDesk(mission, clock=lambda: self.now)
        self.panel = OrderPanel(mission, self.desk, clock=lambda: self.now, changed=lambda: None)
        self.panel.link = SimpleNamespace(connected=True)
        patch.setattr(orders, "await_formation", AsyncMock())
        patch.setattr(orders, "await_order", AsyncMock())
        patch.setattr(orders, "rehearse_order", self.rehearse)
        patch.setattr(orders, "give_rehearsed", self.give)

    async def rehearse(self, _: Mission, order: Order, *__: object) -> RehearsedOrder:
        await self.waits.wait()
        if self.refusal is not None:
            raise VfguideError(self.refusal)
        formation = formation_of_mission(self.mission)
        arrangement, _ = resolve(self.mission, order, formation, number=1, time_s=10.0)
        prediction = Prediction(
            least_m=14.61, pair=("f1", "f3"), least_s=4.5, settled_s=18.2, moved_s=18.2
        )
        return RehearsedOrder(
            order=order,
            formation=formation,
            arrangement=arrangement,
            prediction=None if order.action == "abort" else prediction,
        )

    async def give(
        self, _: Mission, found: RehearsedOrder, desk: OrderDesk, *__: object, **___: object
    ) -> OrderOutcome:
        await self.waits.wait()
        self.given.append(found.arrangement.flown)
        desk.awaited = frozenset(("leader", "f1", "f2", "f3"))
        desk.replies = {
            name: Reply(number=1, verdict=verdict, check=0, text="too fast" * (verdict == 2))
            for name, verdict in self.verdicts.items()
        }
        return OrderOutcome(
            number=1,
            arrangement=found.arrangement,
            prediction=found.prediction,
            replies=desk.replies,
            silent=tuple(sorted(desk.awaited - set(desk.replies))),
        )

    async def settle(self) -> dict[str, Any]:
        """What is shown once nothing goes on any more."""
        for _ in range(10):
            await asyncio.sleep(0)
        return self.panel.describe()


@pytest.fixture
def air(monkeypatch: pytest.MonkeyPatch) -> Air:
    """A leader and three followers."""
    return Air(shipped("shapes"), monkeypatch)


async def test_what_a_rehearsal_has_found_is_shown_before_the_order_can_be_given(air):
    number = air.panel.rehearse(VEE)
    assert air.panel.describe()["phase"] == "rehearsing"
    with pytest.raises(BusyError):
        air.panel.give(number)
    shown = await air.settle()
    assert shown["phase"] == "rehearsed"
    assert shown["what"] == "vee, spacing 30 m"
    assert shown["outcome"] == {
        "pair": ["f1", "f3"],
        "least_m": 14.6,
        "least_s": 4,
        "settled_s": 18,
        "slots": "vee, 30 m apart",
    }
    assert air.given == []
    air.panel.give(number)
    shown = await air.settle()
    assert shown["phase"] == "flown"
    assert shown["answers"][0] == {"vehicle": "f1", "says": "flown", "text": ""}
    assert air.given == [Manoeuvre.FORMATION]
    # Once is enough.
    with pytest.raises(BusyError):
        air.panel.give(number)


async def test_a_refusal_is_shown_with_its_sentence_and_cannot_be_given(air):
    air.refusal = "f1 and f2 would come within 4.0 m of each other"
    number = air.panel.rehearse(VEE)
    shown = await air.settle()
    assert (shown["phase"], shown["text"]) == ("refused", air.refusal)
    with pytest.raises(BusyError):
        air.panel.give(number)


async def test_only_the_rehearsal_that_was_shown_and_not_one_of_long_ago_is_given(air):
    first = air.panel.rehearse(VEE)
    await air.settle()
    second = air.panel.rehearse(Order(shape="trail"))
    await air.settle()
    with pytest.raises(BusyError, match="rehearse it again"):
        air.panel.give(first)
    air.now += FRESH_S + 1.0
    with pytest.raises(BusyError, match="too old"):
        air.panel.give(second)
    assert air.given == []


async def test_there_is_one_order_at_a_time_and_an_abort_waits_for_none(air):
    number = air.panel.rehearse(VEE)
    await air.settle()
    air.waits.clear()
    air.panel.give(number)
    with pytest.raises(BusyError, match="vee, spacing 30 m"):
        air.panel.rehearse(Order(shape="trail"))
    air.panel.abort()
    air.waits.set()
    shown = await air.settle()
    assert (shown["phase"], shown["what"]) == ("flown", "abort")
    assert air.given == [Manoeuvre.ABORT]


async def test_who_says_no_and_who_is_silent_is_shown_of_an_order_that_is_void(air):
    air.verdicts = {"leader": Verdict.VOID, "f1": Verdict.VOID, "f2": Verdict.REFUSED}
    number = air.panel.rehearse(VEE)
    await air.settle()
    air.panel.give(number)
    shown = await air.settle()
    assert shown["phase"] == "void"
    assert [(one["vehicle"], one["says"], one["text"]) for one in shown["answers"]] == [
        ("f1", "void", ""),
        ("f2", "refused", "too fast"),
        ("f3", "silent", ""),
        ("leader", "void", ""),
    ]


async def test_a_fault_of_the_console_itself_ends_no_stream(air):
    air.panel.link = None
    air.panel.rehearse(VEE)
    shown = await air.settle()
    assert (shown["phase"], shown["text"]) == ("refused", "the link is not open yet: try again")


async def test_an_order_that_nobody_wants_is_dropped_while_it_is_rehearsed_and_after(air):
    air.waits.clear()
    number = air.panel.rehearse(VEE)
    await asyncio.sleep(0)
    air.panel.drop(number)
    air.waits.set()
    assert (await air.settle())["phase"] == "none"
    number = air.panel.rehearse(VEE)
    assert (await air.settle())["phase"] == "rehearsed"
    with pytest.raises(BusyError):
        air.panel.drop(number - 1)
    air.panel.drop(number)
    with pytest.raises(BusyError):
        air.panel.give(number)
    assert air.given == []


async def test_a_new_rehearsal_takes_the_place_of_one_that_still_runs(air):
    air.waits.clear()
    air.panel.rehearse(VEE)
    await asyncio.sleep(0)
    number = air.panel.rehearse(Order(shape="trail", spacing=30.0))
    air.waits.set()
    shown = await air.settle()
    assert (shown["number"], shown["what"]) == (number, "trail, spacing 30 m")
    assert shown["phase"] == "rehearsed"


async def test_an_order_that_is_being_given_is_neither_dropped_nor_replaced(air):
    number = air.panel.rehearse(VEE)
    await air.settle()
    air.waits.clear()
    air.panel.give(number)
    with pytest.raises(BusyError):
        air.panel.drop(number)
    with pytest.raises(BusyError):
        air.panel.rehearse(VEE)
    air.waits.set()
    assert (await air.settle())["phase"] == "flown"


LOOK, OPERATOR = "l" * 24, "o" * 24
LOOKS, ORDERS = f"look={LOOK}", f"look={LOOK}; operator={OPERATOR}"
HOST, ORIGIN = "127.0.0.1:8080", "http://127.0.0.1:8080"
VEE_REQUEST = b'{"shape": "vee", "spacing_m": 30}'


class Panel(OrderPanel):
    """Notes what it is asked for."""

    def __init__(self) -> None:
        super().__init__(
            shipped("shapes"), OrderDesk(shipped("shapes")), clock=lambda: 0.0, changed=int
        )
        self.asked: list[object] = []

    def rehearse(self, order: Order) -> int:
        self.asked.append(order)
        return 1

    def give(self, number: int) -> None:
        if number != 1:
            raise BusyError("rehearse it again")
        self.asked.append(number)

    def drop(self, number: int) -> None:
        self.asked.append(("drop", number))

    def abort(self) -> int:
        self.asked.append("abort")
        return 2


class Nothing(Source):
    """A flight without anything."""

    def opening(self) -> str:
        return "{}"


@pytest.fixture
def panel() -> Panel:
    return Panel()


def post(
    path: str,
    body: bytes,
    *,
    panel: OrderPanel | None = None,
    operators: bool = True,
    method: str = "POST",
    **headers: str,
) -> tuple[int, str]:
    """(status, text) of what a request is answered; headers in the place of a page's own, empty for none."""
    source = Nothing()
    source.panel = panel or Panel()
    doors = Access(
        look=AccessToken(token=LOOK, cookie="look"),
        order=AccessToken(token=OPERATOR, cookie="operator") if operators else None,
        secure=False,
    )
    own = {"host": HOST, "origin": ORIGIN, "cookie": ORDERS, "content-type": "application/json"}
    given_headers = own | {name.replace("_", "-"): value for name, value in headers.items()}
    scope: dict[str, Any] = {
        "type": "http",
        "http_version": "1.1",
        "method": method,
        "path": path,
        "raw_path": path.encode(),
        "root_path": "",
        "scheme": "http",
        "query_string": b"",
        "headers": [(k.encode(), v.encode()) for k, v in given_headers.items() if v],
        "server": ("127.0.0.1", 8080),
        "client": ("127.0.0.1", 50000),
    }
    parts = [body[start : start + 1000] for start in range(0, len(body), 1000)] or [b""]
    sent: list[MutableMapping[str, Any]] = []

    async def receive() -> MutableMapping[str, Any]:
        part = parts.pop(0)
        return {"type": "http.request", "body": part, "more_body": bool(parts)}

    async def send(message: MutableMapping[str, Any]) -> None:
        sent.append(message)

    app: Callable[..., Awaitable[None]] = application(source, title="flight", doors=doors)
    asyncio.run(app(scope, receive, send))
    text = b"".join(message.get("body", b"") for message in sent[1:]).decode()
    return sent[0]["status"], text


def test_an_operator_s_page_has_an_order_rehearsed_given_and_everything_called_off(panel):
    assert post("/order/rehearse", VEE_REQUEST, panel=panel) == (202, '{"number":1}')
    assert post("/order/give", b'{"number": 1}', panel=panel)[0] == 202
    assert post("/order/abort", b"{}", panel=panel) == (202, '{"number":2}')
    assert panel.asked == [Order(shape="vee", spacing=30.0), 1, "abort"]


@pytest.mark.parametrize(
    "headers",
    [
        {"cookie": ""},
        {"cookie": LOOKS},
        {"cookie": f"look={LOOK}; operator={LOOK}"},
        {"cookie": f"operator={OPERATOR[:-1]}"},
        {"origin": ""},
        {"origin": "null"},
        {"origin": "http://evil.example"},
        {"origin": "https://127.0.0.1:8080"},
        {"origin": "http://127.0.0.1:8081"},
        {"origin": "http://127.0.0.1:8080.evil.example"},
        {"sec_fetch_site": "cross-site"},
        {"sec_fetch_site": "same-site"},
    ],
)
def test_nobody_else_orders(panel, headers):
    for path, body in (("rehearse", VEE_REQUEST), ("give", b'{"number": 1}'), ("abort", b"{}")):
        status, _ = post(f"/order/{path}", body, panel=panel, **headers)
        assert status == 403
    assert panel.asked == []


@pytest.mark.parametrize("path", ["rehearse", "give", "abort"])
def test_without_operators_nothing_can_be_changed(panel, path):
    answer = post(f"/order/{path}", VEE_REQUEST, panel=panel, operators=False)
    assert answer == (405, "Nothing can be changed here.\n")
    assert panel.asked == []


@pytest.mark.parametrize("method", ["GET", "PUT", "DELETE", "PATCH", "OPTIONS"])
def test_orders_are_posted(panel, method):
    assert post("/order/abort", b"{}", panel=panel, method=method)[0] == 405
    assert panel.asked == []


@pytest.mark.parametrize(
    "body",
    [
        b"",
        b"{}",
        b"[]",
        b"null",
        b"{",
        b'{"shape": "vee"} {}',
        b'{"shape": "wedge"}',
        b'{"swap": ["f1"]}',
        b'{"swap": ["f1", "f2", "f3"]}',
        b'{"leave": "f1"}',
        b'{"leave": [1]}',
        b'{"action": "land"}',
        b'{"shape": "vee", "at_s": 10}',
        b'{"slots": {"f1": {"forward_m": 1e300, "right_m": 0}}}',
        b'{"shape": "\xff"}',
        b"[" * 4000,
    ],
)
def test_what_is_no_order_is_one_line(panel, body):
    status, text = post("/order/rehearse", body, panel=panel)
    assert status == 422
    assert text.count("\n") == 1
    assert ": " in text
    assert "Input" not in text
    assert panel.asked == []


def test_a_spacing_that_is_none_is_answered_with_the_limits(panel):
    for spacing in (b"0", b"1e9", b"NaN", b'"30"'):
        body = b'{"shape": "vee", "spacing_m": ' + spacing + b"}"
        assert post("/order/rehearse", body, panel=panel) == (
            422,
            "The spacing has to be a number from 1 to 1000 m: correct it and rehearse again.\n",
        )
    assert panel.asked == []


def test_a_rehearsed_order_is_dropped_by_its_number(panel):
    assert post("/order/drop", b'{"number": 4}', panel=panel) == (202, '{"number":4}')
    assert post("/order/drop", b"{}", panel=panel)[0] == 422
    assert panel.asked == [("drop", 4)]


def test_long_bodies_are_not_read(panel):
    body = VEE_REQUEST + b" " * LARGEST_BODY
    assert post("/order/rehearse", body, panel=panel)[0] == 413
    assert panel.asked == []


@pytest.mark.parametrize("kind", ["", "text/plain", "application/x-www-form-urlencoded"])
def test_what_a_form_of_another_site_could_send_is_refused(kind):
    assert post("/order/abort", b"{}", content_type=kind)[0] == 415


def test_an_order_that_is_not_the_one_that_was_shown_is_not_given():
    assert post("/order/give", b'{"number": 7}') == (409, "rehearse it again\n")
    for body in (b'{"number": "1"}', b'{"number": 1.0}', b'{"number": 1, "force": true}', b"{}"):
        assert post("/order/give", body)[0] == 422


@settings(max_examples=60, deadline=None)
@given(
    st.recursive(
        st.none() | st.booleans() | st.floats() | st.text(max_size=8),
        lambda one: (
            st.lists(one, max_size=3)
            | st.dictionaries(
                st.sampled_from(["shape", "slots", "swap", "action", "leave"]), one, max_size=3
            )
        ),
        max_leaves=6,
    )
)
def test_whatever_is_sent_is_answered(content):
    status, _ = post("/order/rehearse", json.dumps(content).encode())
    assert status in {202, 422}


@pytest.fixture(scope="module")
def services() -> dict[str, Any]:
    """All services of docker-compose.yml, by name."""
    return yaml.safe_load((ROOT / "docker-compose.yml").read_text(encoding="utf-8"))["services"]


def test_docker_compose_up_serves_the_console_beside_the_demonstration(services):
    settings = (ROOT / ".env").read_text(encoding="utf-8").splitlines()
    assert "COMPOSE_PROFILES=demo,console" in settings
    assert services["console"]["profiles"] == ["console"]
    # All that it waits for is there in the demonstration.
    for name in services["console"]["depends_on"]:
        assert "demo" in services[name]["profiles"]


def test_one_setting_asks_for_orders_and_is_off_unless_set(services):
    assert services["console"]["environment"]["ORDERS"] == "${CONSOLE_ORDERS:-}"
    assert services["broker"]["environment"]["ORDERS"] == "${CONSOLE_ORDERS:-}"
    assert services["console"]["environment"]["VEHICLE"] == "console"
    assert "console" in services["keys"]["environment"]["OPERATORS"].split()


@pytest.mark.parametrize(("orders", "given"), [("", False), ("no", False), ("yes", True)])
def test_the_console_is_started_with_operator_only_where_orders_are_asked_for(
    tmp_path, orders, given
):
    vfguide = tmp_path / "vfguide"
    vfguide.write_text('#!/bin/sh\nprintf "%s\\n" "$@"\n')
    vfguide.chmod(0o755)
    (tmp_path / "link-options").write_text("LINK=mqtts://console@broker\n")
    who = {"VEHICLE": "console", "BROKER": "broker", "PUBLISHED": "8080", "ORDERS": orders}
    said = subprocess.run(
        ["/bin/sh", str(ROOT / "docker" / "bin" / "run-console")],
        env={"PATH": f"{tmp_path}:{os.environ['PATH']}", **who},
        capture_output=True,
        text=True,
        check=True,
        timeout=60.0,
    ).stdout.split()
    assert ("--operator" in said) is given
    assert "http://127.0.0.1:8080" in said
