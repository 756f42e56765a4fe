"""The console as a web server: one page, its program, and a stream of what there is to show."""

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

# The files of the console's page, put together: what a browser gets of them.

OWN_SCRIPTS = ("live.js", "tiles.js", "cards.js", "orders.js", "console.js")


def render_page(title: str) -> str:
    """The page; the name of a mission stays text in it."""
    parts = {
        "{title}": escape(title),
        "{orders}": read_page("orders.html"),
        "{replay}": read_replay("replay.html").replace("<!-- below -->", read_page("cards.html")),
    }
    # In one pass: a title is not looked at again.
    names = re.compile("|".join(map(re.escape, parts)))
    return names.sub(lambda found: parts[found[0]], read_page("console.html"))


def join_style() -> str:
    """All styles as one."""
    report = files("vfguide.lab.report").joinpath("page.css").read_text(encoding="utf-8")
    return "\n".join([report, read_replay("replay.css"), read_page("console.css")])


def read_page(name: str) -> str:
    """A file of the page."""
    return files("vfguide.lab.console").joinpath("page", name).read_text(encoding="utf-8")


POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; base-uri 'none';"
    " form-action 'none'; frame-ancestors 'none'"
)
"""The page's own program, style and stream, and nothing else."""

HEADERS = {
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cache-control": "no-store",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
}
"""Headers of every answer, beside the policy."""

QUIET_S = 5.0
"""After so long without news a stream says that it is still there."""

REQUEST_S = 5.0
"""A connection on which nothing is asked for, nor answered, ends after so long."""

MOST_SILENT = 100
"""Such connections at once: the oldest ends for a new one, which may be an operator's."""

CLOSING_S = 1
"""For open streams to end, s."""

LARGEST_BODY = 4096
"""Bytes of what a page sends."""

REFUSED = "This address needs the token that `vfguide console` printed: open the whole address.\n"
READ_ONLY = "Nothing can be changed here.\n"
NOT_OPERATOR = (
    "Orders need the second address that `vfguide console --operator` printed: open that one.\n"
)
FROM_ELSEWHERE = "Orders are taken from the console's own page alone.\n"


@dataclass(frozen=True, slots=True, kw_only=True)
class ConsoleAddress:
    """Where the console is served, and how."""

    host: str = "127.0.0.1"
    """Name or address of the interface."""
    port: int = 8080
    """0 for any that is free."""
    certificate: Path | None = None
    """PEM file for TLS."""
    certificate_key: Path | None = None
    """File of the certificate's private key, if that is not in the same file."""
    published: str | None = None
    """URL of this computer's own under which others bring in who comes, as a container's engine does."""

    def check(self) -> None:
        """See that nobody on a network reads along.

        Raises:
            InputError: the host is not this computer alone, and there is no certificate.
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
        """Scheme of its URL."""
        return "http" if self.certificate is None else "https"

    def url(self, port: int) -> str:
        """URL of the page, on the port (1 to 65535) on which it is served."""
        if self.published is not None:
            return self.published.rstrip("/")
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{self.scheme}://{host}:{port}"


def is_loopback(host: str) -> bool:
    """Whether only programs of this computer come in there."""
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def is_own_url(text: str) -> bool:
    """Whether a text is an http address that only programs of this computer reach."""
    try:
        parts = urlsplit(text)
        loopback, _ = is_loopback(parts.hostname or ""), parts.port
    except ValueError:
        return False
    return loopback and parts.scheme == "http" and parts.path in {"", "/"} and not parts.query


@dataclass(frozen=True, slots=True, kw_only=True)
class AccessToken:
    """A token that lets in, and the cookie that keeps it."""

    token: str
    """Random text that grants access."""
    cookie: str
    """Name of the cookie."""

    def is_token(self, given: str | None) -> bool:
        """Whether a text is the token."""
        return given is not None and hmac.compare_digest(given.encode(), self.token.encode())

    def is_held(self, connection: HTTPConnection) -> bool:
        """Whether a request has the cookie."""
        return self.is_token(connection.cookies.get(self.cookie))


@dataclass(frozen=True, slots=True, kw_only=True)
class Access:
    """Who is let in."""

    look: AccessToken
    """Token of users who may only look."""
    order: AccessToken | None
    """Token of users who may give orders, too; None where orders are not allowed."""
    secure: bool
    """Whether it is served by TLS, and cookies are for TLS alone."""

    def may_order(self, connection: HTTPConnection) -> bool:
        """Whether a request is an operator's."""
        return self.order is not None and self.order.is_held(connection)

    def is_own(self, connection: HTTPConnection) -> bool:
        """Whether a request was made by the console's own page, by what the browser says of it.

        Browsers name the origin in every POST. Its host has to be the one that the request was sent to; a
        name of somebody else's that leads here has no cookie.
        """
        scheme = "https" if self.secure else "http"
        own = f"{scheme}://{connection.headers.get('host', '')}"
        site = connection.headers.get("sec-fetch-site", "same-origin")
        return connection.headers.get("origin") == own and site == "same-origin"


class Guard:
    """Lets in who has a token, in the address or in a cookie, and puts the headers on every answer."""

    def __init__(self, app: ASGIApp, doors: Access, *, pictures: str = "") -> None:
        """Stand before an application.

        Args:
            app: the application.
            doors: who is let in.
            pictures: where the page may take pictures from, as its policy names it; nowhere if empty.
        """
        self._app, self._doors = app, doors
        policy = f"{POLICY}; img-src {pictures}" if pictures else POLICY
        self._headers = {"content-security-policy": policy, **HEADERS}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request."""
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
        """To the page itself: the token stays in no list of addresses that were visited."""
        answer, look, secure = (
            RedirectResponse("/", status_code=303),
            self._doors.look,
            self._doors.secure,
        )
        # A strict cookie would not go with this redirection of a link on another site. A lax one goes with
        # no request of other sites but for the page itself, which they can neither read nor frame.
        answer.set_cookie(look.cookie, look.token, httponly=True, samesite="lax", secure=secure)
        if operator is not None:
            # Orders are sent by the page itself: this cookie goes with no request of another site at all.
            answer.set_cookie(
                operator.cookie, operator.token, httponly=True, samesite="strict", secure=secure
            )
        return answer


def application(source: Source, *, title: str, doors: Access) -> ASGIApp:
    """Everything that is served.

    Args:
        source: the flight.
        title: what the page calls it.
        doors: who is let in.
    """
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
    """Where pages get tiles of the map by their numbers."""

    async def show_tile(request: Request) -> Response:
        numbers = request.path_params
        tile = find(numbers["z"], numbers["x"], numbers["y"])
        if tile is None:
            return PlainTextResponse("There is no such tile.\n", status_code=404)
        return Response(tile.data, media_type=tile.kind)

    return Route("/tiles/{z:int}/{x:int}/{y:int}", show_tile)


def order_routes(panel: OrderPanel) -> list[Route]:
    """Where pages send orders; each answer is a number of a rehearsal, or a sentence."""

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
    """Do what a page has sent, and answer it; a fault is one line."""
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
    """Server-sent events: whether the page may order, the flight so far, then what is added, for ever."""
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
    """A connection that has to ask for something soon: idle ones keep nobody out."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Let the oldest silent connection go where there are too many."""
        super().connection_made(transport)
        self._wait()
        silent = [one for one in self.connections if isinstance(one, Reception) and one.is_silent]
        if len(silent) > MOST_SILENT:
            min(silent, key=lambda one: one.since_s).transport.close()

    def on_response_complete(self) -> None:
        """Wait for the next request."""
        super().on_response_complete()
        self._wait()

    @property
    def is_silent(self) -> bool:
        """Whether nothing is asked for that is not answered yet."""
        return self.cycle is None or self.cycle.response_complete

    def _wait(self) -> None:
        self.since_s = self.loop.time()
        """Since when nothing was asked for, s of the event loop's clock."""
        self.loop.call_later(REQUEST_S, self._end_if_silent, self.since_s)

    def _end_if_silent(self, since_s: float) -> None:
        if self.is_silent and self.since_s == since_s:
            self.transport.close()


class QuietServer(uvicorn.Server):
    """Leaves signals to its caller."""

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Capture none."""
        yield


def listen(address: ConsoleAddress) -> socket:
    """A socket that listens.

    Raises:
        InputError: the host is none of this computer, or the port is not to be had.
    """
    family = AF_INET6 if ":" in address.host else AF_INET
    opened = socket(family, SOCK_STREAM)
    # Windows would let a second program take the port.
    if os.name == "posix":
        opened.setsockopt(SOL_SOCKET, SO_REUSEADDR, 1)
    try:
        opened.bind((address.host, address.port))
        # From here on a page that comes before the server runs waits, and is not turned away.
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
    """Serve a flight for as long as the context lasts.

    Args:
        source: the flight.
        address: where.
        title: what the page calls it.
        token: that lets in; one of chance if absent.
        operator_token: that lets operators in, who give orders; nobody does if absent.

    Yields:
        The address to open, with its token.

    Raises:
        InputError: it cannot be served there, or the certificate cannot be used.
    """
    address.check()
    token = token or secrets.token_urlsafe(24)
    opened = listen(address)
    try:
        port = opened.getsockname()[1]
        # Cookies do not tell ports apart: two consoles of one computer have two names.
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
    """How the server runs.

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
