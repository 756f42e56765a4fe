"""Web server of the console: one page, its script and a stream of events."""

import asyncio
import hmac
import os
import re
import secrets
import ssl
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager
from dataclasses import dataclass
from functools import partial
from html import escape
from importlib.resources import files
from ipaddress import ip_address
from pathlib import Path
from socket import AF_INET, AF_INET6, SO_REUSEADDR, SOCK_STREAM, SOL_SOCKET, socket
from urllib.parse import urlsplit

import uvicorn
from pydantic import ValidationError
from starlette.applications import Starlette
from starlette.requests import HTTPConnection, Request
from starlette.responses import (
    JSONResponse,
    PlainTextResponse,
    RedirectResponse,
    Response,
    StreamingResponse,
)
from starlette.routing import Route
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol

from vfguide.errors import InputError
from vfguide.lab.console.orders import (
    BusyError,
    EmptyRequest,
    OrderPanel,
    fault_in_words,
    order_from,
    use_number,
)
from vfguide.lab.console.source import Source
from vfguide.lab.console.tiles import FindTile
from vfguide.lab.report.replay import program as joined_program
from vfguide.lab.report.replay import read as read_replay

OWN_SCRIPTS = ("live.js", "tiles.js", "cards.js", "orders.js", "console.js")


def render_page(title: str) -> str:
    """Return the page as HTML, with the mission's name escaped."""
    parts = {
        "{title}": escape(title),
        "{orders}": read_page("orders.html"),
        "{replay}": read_replay("replay.html").replace("<!-- below -->", read_page("cards.html")),
    }
    # A single pass, so that a placeholder within the title is not replaced.
    names = re.compile("|".join(map(re.escape, parts)))
    return names.sub(lambda found: parts[found[0]], read_page("console.html"))


def join_style() -> str:
    """Return all style sheets as one."""
    report = files("vfguide.lab.report").joinpath("page.css").read_text(encoding="utf-8")
    return "\n".join([report, read_replay("replay.css"), read_page("console.css")])


def read_page(name: str) -> str:
    """Return a file of the console's page."""
    return files("vfguide.lab.console").joinpath("page", name).read_text(encoding="utf-8")


POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; base-uri 'none';"
    " form-action 'none'; frame-ancestors 'none'"
)
"""Content security policy: only the page's own script, style and stream."""

HEADERS = {
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cache-control": "no-store",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
}
"""Headers of every response, besides the policy."""

QUIET_S = 5.0
"""Time without news after which a stream sends a sign of life, s."""

REQUEST_S = 5.0
"""Time after which a connection without a pending request is closed, s."""

MOST_SILENT = 100
"""Silent connections kept at once; beyond, the oldest makes room for a new one, perhaps an operator's."""

CLOSING_S = 1
"""Time that open streams get to end at shutdown, s."""

LARGEST_BODY = 4096
"""Longest body of a request, bytes."""

REFUSED = "This address needs the token that `vfguide console` printed: open the whole address.\n"
READ_ONLY = "Nothing can be changed here.\n"
NOT_OPERATOR = (
    "Orders need the second address that `vfguide console --operator` printed: open that one.\n"
)
FROM_ELSEWHERE = "Orders are taken from the console's own page alone.\n"


@dataclass(frozen=True, slots=True, kw_only=True)
class ConsoleAddress:
    """Address of the console and its TLS files."""

    host: str = "127.0.0.1"
    port: int = 8080
    """TCP port; 0 for any free one."""
    certificate: Path | None = None
    """PEM file for TLS; None for plain HTTP."""
    certificate_key: Path | None = None
    """PEM file of the private key; None where the certificate's file holds it."""
    published: str | None = None
    """Loopback URL under which others, such as a container engine, forward connections to the console."""

    def check(self) -> None:
        """Check that nobody on the network can read along.

        Raises:
            InputError: the host is reachable from outside without a certificate, the certificate's key stands
                alone, or `published` is no loopback URL.
        """
        if self.published is not None and not is_own_url(self.published):
            raise InputError(
                f"--published {self.published}: is no http address of this computer alone; write it as"
                " http://127.0.0.1:8080, or give --certificate and leave it out"
            )
        if self.certificate is None and self.certificate_key is not None:
            raise InputError("--certificate-key: is of no use alone; give --certificate, too")
        open_to_others = not is_loopback(self.host) and self.published is None
        if self.certificate is None and open_to_others:
            raise InputError(
                f"--host {self.host}: others on the network could read along and take the token; give"
                " --certificate and --certificate-key, or leave --host out"
            )

    @property
    def scheme(self) -> str:
        """URL scheme: http, or https with a certificate."""
        return "http" if self.certificate is None else "https"

    def url(self, port: int) -> str:
        """Return the page's URL, where `port` (1 to 65535) is the port in use."""
        if self.published is not None:
            return self.published.rstrip("/")
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{self.scheme}://{host}:{port}"


def is_loopback(host: str) -> bool:
    """Check whether a host can be reached only from this computer."""
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def is_own_url(text: str) -> bool:
    """Check whether a text is an http URL of the loopback interface."""
    try:
        parts = urlsplit(text)
        loopback, _ = is_loopback(parts.hostname or ""), parts.port
    except ValueError:
        return False
    return loopback and parts.scheme == "http" and parts.path in {"", "/"} and not parts.query


@dataclass(frozen=True, slots=True, kw_only=True)
class AccessToken:
    """Token that grants access, and the name of the cookie that keeps it."""

    token: str
    cookie: str

    def is_token(self, given: str | None) -> bool:
        """Compare a text with the token in constant time."""
        return given is not None and hmac.compare_digest(given.encode(), self.token.encode())

    def is_held(self, connection: HTTPConnection) -> bool:
        """Check whether a request carries the token in its cookie."""
        return self.is_token(connection.cookies.get(self.cookie))


@dataclass(frozen=True, slots=True, kw_only=True)
class Access:
    """Access rights of users and operators."""

    look: AccessToken
    order: AccessToken | None
    """Token to give orders as well; None where orders are not allowed."""
    secure: bool
    """Whether the console uses TLS, so that cookies are sent over TLS alone."""

    def may_order(self, connection: HTTPConnection) -> bool:
        """Check whether a request comes from an operator."""
        return self.order is not None and self.order.is_held(connection)

    def is_own(self, connection: HTTPConnection) -> bool:
        """Check from the browser's headers whether a request comes from the console's own page.

        Browsers name the origin in every POST. The origin must match the host of the request. A foreign name
        that resolves to this computer has no cookie.
        """
        scheme = "https" if self.secure else "http"
        own = f"{scheme}://{connection.headers.get('host', '')}"
        site = connection.headers.get("sec-fetch-site", "same-origin")
        return connection.headers.get("origin") == own and site == "same-origin"


class Guard:
    """Middleware that asks for a token in the URL or a cookie, and adds the headers to every response."""

    def __init__(self, app: ASGIApp, doors: Access, *, pictures: str = "") -> None:
        """Wrap `app`; `pictures` is the policy's source of images, none if empty."""
        self._app, self._doors = app, doors
        policy = f"{POLICY}; img-src {pictures}" if pictures else POLICY
        self._headers = {"content-security-policy": policy, **HEADERS}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request."""
        if scope["type"] != "http":
            return

        async def send_guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                given = [(name.encode(), value.encode()) for name, value in self._headers.items()]
                own = {name for name, _ in given}
                kept = [(name, value) for name, value in message["headers"] if name not in own]
                message = {**message, "headers": [*kept, *given]}
            await send(message)

        await self._answer(scope)(scope, receive, send_guarded)

    def _answer(self, scope: Scope) -> ASGIApp:
        connection, doors = HTTPConnection(scope), self._doors
        if scope["method"] == "POST" and doors.order is not None:
            return self._answer_order(connection)
        if scope["method"] not in {"GET", "HEAD"}:
            return PlainTextResponse(READ_ONLY, status_code=405)
        token = connection.query_params.get("token")
        if doors.order is not None and doors.order.is_token(token):
            return self._welcome(operator=doors.order)
        if doors.look.is_token(token):
            return self._welcome()
        if doors.look.is_held(connection):
            return self._app
        return PlainTextResponse(REFUSED, status_code=403)

    def _answer_order(self, connection: HTTPConnection) -> ASGIApp:
        if not self._doors.may_order(connection):
            return PlainTextResponse(NOT_OPERATOR, status_code=403)
        if not self._doors.is_own(connection):
            return PlainTextResponse(FROM_ELSEWHERE, status_code=403)
        if connection.headers.get("content-type") != "application/json":
            return PlainTextResponse("An order is JSON.\n", status_code=415)
        return self._app

    def _welcome(self, operator: AccessToken | None = None) -> Response:
        """Set the cookies and redirect to the bare page: the token stays out of the browser's history."""
        answer, look, secure = (
            RedirectResponse("/", status_code=303),
            self._doors.look,
            self._doors.secure,
        )
        # A strict cookie would not survive this redirect from a link on another site. A lax one goes with no
        # cross-site request but for the page itself, which other sites can neither read nor frame.
        answer.set_cookie(look.cookie, look.token, httponly=True, samesite="lax", secure=secure)
        if operator is not None:
            # The page itself sends orders, so this cookie need not go with any cross-site request.
            answer.set_cookie(
                operator.cookie, operator.token, httponly=True, samesite="strict", secure=secure
            )
        return answer


def application(source: Source, *, title: str, doors: Access) -> ASGIApp:
    """Return the whole web application, with `title` as the heading of its page."""
    page, style = render_page(title), join_style()
    program = joined_program("startConsole", map(read_page, OWN_SCRIPTS))

    async def show_page(_: Request) -> Response:
        return Response(page, media_type="text/html")

    async def show_program(_: Request) -> Response:
        return Response(program, media_type="text/javascript")

    async def show_style(_: Request) -> Response:
        return Response(style, media_type="text/css")

    async def stream(request: Request) -> Response:
        may_order = doors.may_order(request)
        if not source.has_room(may_order=may_order):
            return PlainTextResponse("Too many pages are open.\n", status_code=503)
        events = events_of(source, may_order=may_order)
        return StreamingResponse(events, media_type="text/event-stream")

    routes = [
        Route("/", show_page),
        Route("/console.js", show_program),
        Route("/console.css", show_style),
        Route("/flight", stream),
    ]
    if source.panel is not None and doors.order is not None:
        routes += order_routes(source.panel)
    tiles = source.tiles
    if tiles is not None and tiles.find is not None:
        routes.append(tile_route(tiles.find))
    return Guard(Starlette(routes=routes), doors, pictures="" if tiles is None else tiles.origin)


def tile_route(find: FindTile) -> Route:
    """Return the route of the map tiles, by zoom, column and row."""

    async def show_tile(request: Request) -> Response:
        numbers = request.path_params
        tile = find(numbers["z"], numbers["x"], numbers["y"])
        if tile is None:
            return PlainTextResponse("There is no such tile.\n", status_code=404)
        return Response(tile.data, media_type=tile.kind)

    return Route("/tiles/{z:int}/{x:int}/{y:int}", show_tile)


def order_routes(panel: OrderPanel) -> list[Route]:
    """Return the routes for orders; each answers with the number of a rehearsal or with a sentence."""

    async def rehearse(request: Request) -> Response:
        return await answer_post(request, lambda body: panel.rehearse(order_from(body)))

    async def give(request: Request) -> Response:
        return await answer_post(request, partial(use_number, panel.give))

    async def drop(request: Request) -> Response:
        return await answer_post(request, partial(use_number, panel.drop))

    async def abort(request: Request) -> Response:
        def called_off(body: bytes) -> int:
            EmptyRequest.model_validate_json(body)
            return panel.abort()

        return await answer_post(request, called_off)

    return [
        Route("/order/rehearse", rehearse, methods=["POST"]),
        Route("/order/give", give, methods=["POST"]),
        Route("/order/drop", drop, methods=["POST"]),
        Route("/order/abort", abort, methods=["POST"]),
    ]


async def answer_post(request: Request, use: Callable[[bytes], int]) -> Response:
    """Handle the body of a POST and answer; an error is one line of text."""
    body = bytearray()
    async for part in request.stream():
        body += part
        if len(body) > LARGEST_BODY:
            return PlainTextResponse("This is too long for an order.\n", status_code=413)
    try:
        number = use(bytes(body))
    except ValidationError as error:
        return PlainTextResponse(f"{fault_in_words(error)}\n", status_code=422)
    except BusyError as error:
        return PlainTextResponse(f"{error}\n", status_code=409)
    return JSONResponse({"number": number}, status_code=202)


async def events_of(source: Source, *, may_order: bool = False) -> AsyncIterator[str]:
    """Yield server-sent events: the operator's right if held, the flight so far, then updates without end."""
    with source.page() as queue:
        if may_order:
            yield "event: operator\ndata:\n\n"
        yield f"event: flight\ndata: {source.opening()}\n\n"
        while True:
            try:
                async with asyncio.timeout(QUIET_S):
                    text = await queue.get()
            except TimeoutError:
                yield "event: quiet\ndata:\n\n"
                continue
            if text is None:
                return
            yield f"data: {text}\n\n"


class Reception(H11Protocol):
    """Connection that closes when idle, so that idle clients keep nobody out."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Register the connection, and close the oldest silent one if there are too many."""
        super().connection_made(transport)
        self._wait()
        silent = [one for one in self.connections if isinstance(one, Reception) and one.is_silent]
        if len(silent) > MOST_SILENT:
            min(silent, key=lambda one: one.since_s).transport.close()

    def on_response_complete(self) -> None:
        """Restart the idle timer after a response."""
        super().on_response_complete()
        self._wait()

    @property
    def is_silent(self) -> bool:
        """Whether no request is pending."""
        return self.cycle is None or self.cycle.response_complete

    def _wait(self) -> None:
        self.since_s = self.loop.time()
        """Start of the silence, s of the event loop's clock."""
        self.loop.call_later(REQUEST_S, self._end_if_silent, self.since_s)

    def _end_if_silent(self, since_s: float) -> None:
        if self.is_silent and self.since_s == since_s:
            self.transport.close()


class QuietServer(uvicorn.Server):
    """Server that leaves signals to its caller."""

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Leave the signal handlers alone."""
        yield


def listen(address: ConsoleAddress) -> socket:
    """Return a listening socket.

    Raises:
        InputError: the host is no address of this computer, or the port is not available.
    """
    family = AF_INET6 if ":" in address.host else AF_INET
    opened = socket(family, SOCK_STREAM)
    # On Windows the option would let a second program take the port.
    if os.name == "posix":
        opened.setsockopt(SOL_SOCKET, SO_REUSEADDR, 1)
    try:
        opened.bind((address.host, address.port))
        # From now on a page opened before the server runs waits instead of being refused.
        opened.listen()
    except OSError as error:
        opened.close()
        raise InputError(
            f"--host {address.host} --port {address.port}: cannot listen there"
            f" ({error.strerror or error}); choose another, such as --port {address.port + 1}"
        ) from error
    return opened


@asynccontextmanager
async def served(
    source: Source,
    address: ConsoleAddress,
    *,
    title: str,
    token: str | None = None,
    operator_token: str | None = None,
) -> AsyncIterator[str]:
    """Serve a flight for as long as the context lasts; yield the URL to open, with its token.

    Without `token` a random one is used; without `operator_token` nobody may give orders.

    Raises:
        InputError: the address or the certificate cannot be used.
    """
    address.check()
    token = token or secrets.token_urlsafe(24)
    opened = listen(address)
    try:
        port = opened.getsockname()[1]
        # Cookies do not distinguish ports: two consoles on one computer need two names.
        order = (
            None
            if operator_token is None
            else AccessToken(token=operator_token, cookie=f"vfguide-operator-{port}")
        )
        doors = Access(
            look=AccessToken(token=token, cookie=f"vfguide-console-{port}"),
            order=order,
            secure=address.certificate is not None,
        )
        app = application(source, title=title, doors=doors)
        server = QuietServer(configured(app, address))
        running = asyncio.create_task(server.serve(sockets=[opened]), name="console server")
        try:
            yield f"{address.url(port)}/?token={token}"
        finally:
            source.close()
            server.should_exit = True
            await running
    finally:
        opened.close()


def configured(app: ASGIApp, address: ConsoleAddress) -> uvicorn.Config:
    """Return the server's settings.

    Raises:
        InputError: the certificate cannot be used.
    """
    config = uvicorn.Config(
        app,
        log_config=None,
        access_log=False,
        lifespan="off",
        http=Reception,
        ws="none",
        server_header=False,
        timeout_graceful_shutdown=CLOSING_S,
        ssl_certfile=address.certificate,
        ssl_keyfile=address.certificate_key,
    )
    try:
        config.load()
    except (OSError, ssl.SSLError) as error:
        raise InputError(
            f"--certificate {address.certificate}: cannot be used ({error}); give PEM files of a certificate"
            " and its key"
        ) from error
    return config
