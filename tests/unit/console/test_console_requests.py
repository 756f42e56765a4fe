"""What the console's server makes of orders that are sent to it: whose it takes, and what it refuses."""

import asyncio
import json
from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.kit.missions import shipped
from vfguide.formation.orders import Order
from vfguide.lab.console.orders import BusyError, OrderPanel
from vfguide.lab.console.server import LARGEST_BODY, Access, AccessToken, application
from vfguide.lab.console.source import Source
from vfguide.lab.order_desk import OrderDesk

LOOK, OPERATOR = "l" * 24, "o" * 24
LOOKS, ORDERS = f"look={LOOK}", f"look={LOOK}; operator={OPERATOR}"
HOST, ORIGIN = "127.0.0.1:8080", "http://127.0.0.1:8080"
VEE = b'{"shape": "vee", "spacing_m": 30}'


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
    assert post("/order/rehearse", VEE, panel=panel) == (202, '{"number":1}')
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
    for path, body in (("rehearse", VEE), ("give", b'{"number": 1}'), ("abort", b"{}")):
        status, _ = post(f"/order/{path}", body, panel=panel, **headers)
        assert status == 403
    assert panel.asked == []


@pytest.mark.parametrize("path", ["rehearse", "give", "abort"])
def test_without_operators_nothing_can_be_changed(panel, path):
    answer = post(f"/order/{path}", VEE, panel=panel, operators=False)
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
    body = VEE + b" " * LARGEST_BODY
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
