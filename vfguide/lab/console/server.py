"""The console as a web server: one page, its program, and a stream of what there is to show."""

import asyncio
import hmac
import secrets
import ssl
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from ipaddress import ip_address
from pathlib import Path
from socket import AF_INET, AF_INET6, SO_REUSEADDR, SOCK_STREAM, SOL_SOCKET, socket
from urllib.parse import urlsplit

import uvicorn
from starlette.applications import Starlette
from starlette.requests import HTTPConnection, Request
from starlette.responses import PlainTextResponse, RedirectResponse, Response, StreamingResponse
from starlette.routing import Route
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from vfguide.errors import InputError
from vfguide.lab.console.source import Source
from vfguide.lab.report.replay.page_part import read as read_replay

POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; base-uri 'none';"
    " form-action 'none'; frame-ancestors 'none'"
)
"""The page's own program, style and stream, and nothing else."""

HEADERS = {
    "content-security-policy": POLICY,
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cache-control": "no-store",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
}
"""Of every answer."""

SHARED_SCRIPTS = ("flight.js", "camera.js", "scene.js", "timeline.js", "numbers.js", "player.js")
OWN_SCRIPTS = ("live.js", "cards.js", "console.js")

QUIET_S = 5.0
"""After so long without news a stream says that it is still there."""

MOST_CONNECTIONS = 100
"""At once: more are told to come back later."""

CLOSING_S = 1
"""For open streams to end, s."""

REFUSED = "This address needs the token that `vfguide console` printed: open the whole address.\n"


@dataclass(frozen=True, slots=True, kw_only=True)
class Address:
    """Where the console is served, and how."""

    host: str = "127.0.0.1"
    """Name or address of the interface."""
    port: int = 8080
    """0 for any that is free."""
    certificate: Path | None = None
    """PEM file for TLS."""
    certificate_key: Path | None = None
    """Its private key, if that is not in the same file."""
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
        """Of its URL."""
        return "http" if self.certificate is None else "https"

    def url(self, port: int) -> str:
        """Of the page, on the port (1 to 65535) on which it is served."""
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


class Guard:
    """Lets in who has the token, in the address or in a cookie, and puts the headers on every answer."""

    def __init__(self, app: ASGIApp, *, token: str, cookie: str, secure: bool) -> None:
        """Stand before an application.

        Args:
            app: what is guarded.
            token: that lets in.
            cookie: name of the cookie that keeps it.
            secure: whether the cookie is for TLS alone.
        """
        self._app, self._token, self._cookie, self._secure = app, token, cookie, secure

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request."""
        if scope["type"] != "http":
            return

        async def send_guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                given = [(name.encode(), value.encode()) for name, value in HEADERS.items()]
                own = {name for name, _ in given}
                kept = [(name, value) for name, value in message["headers"] if name not in own]
                message = {**message, "headers": [*kept, *given]}
            await send(message)

        await self._answer(scope)(scope, receive, send_guarded)

    def _answer(self, scope: Scope) -> ASGIApp:
        connection = HTTPConnection(scope)
        if scope["method"] not in {"GET", "HEAD"}:
            return PlainTextResponse("Nothing can be changed here.\n", status_code=405)
        if self._is_token(connection.query_params.get("token")):
            return self._welcome()
        if self._is_token(connection.cookies.get(self._cookie)):
            return self._app
        return PlainTextResponse(REFUSED, status_code=403)

    def _is_token(self, given: str | None) -> bool:
        return given is not None and hmac.compare_digest(given.encode(), self._token.encode())

    def _welcome(self) -> Response:
        """To the page itself: the token stays in no list of addresses that were visited."""
        answer = RedirectResponse("/", status_code=303)
        # A strict cookie would not go with this redirection of a link on another site. A lax one goes with
        # no request of other sites but for the page itself, which they can neither read nor frame.
        answer.set_cookie(
            self._cookie, self._token, httponly=True, samesite="lax", secure=self._secure
        )
        return answer


def application(source: Source, *, title: str, token: str, cookie: str, secure: bool) -> ASGIApp:
    """Everything that is served.

    Args:
        source: the flight.
        title: what the page calls it.
        token: that lets in.
        cookie: name of the cookie that keeps it.
        secure: whether it is served by TLS.
    """
    page, program, style = render_page(title), join_program(), join_style()

    async def show_page(_: Request) -> Response:
        return Response(page, media_type="text/html")

    async def show_program(_: Request) -> Response:
        return Response(program, media_type="text/javascript")

    async def show_style(_: Request) -> Response:
        return Response(style, media_type="text/css")

    async def stream(_: Request) -> Response:
        if source.full:
            return PlainTextResponse("Too many pages are open.\n", status_code=503)
        return StreamingResponse(events_of(source), media_type="text/event-stream")

    routes = [
        Route("/", show_page),
        Route("/console.js", show_program),
        Route("/console.css", show_style),
        Route("/flight", stream),
    ]
    return Guard(Starlette(routes=routes), token=token, cookie=cookie, secure=secure)


async def events_of(source: Source) -> AsyncIterator[str]:
    """Server-sent events: the flight so far, then what is added to it, for ever."""
    with source.page() as queue:
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


def render_page(title: str) -> str:
    """The page; the name of a mission stays text in it."""
    replay = read_replay("replay.html").replace("<!-- below -->", read_page("cards.html"))
    return read_page("console.html").replace("{title}", escape(title)).replace("{replay}", replay)


def join_program() -> str:
    """All scripts as one, which leaves no names behind in the page."""
    shared = [read_replay(name) for name in SHARED_SCRIPTS]
    whole = "\n".join([*shared, *map(read_page, OWN_SCRIPTS)])
    return f'"use strict";\n(() => {{\n{whole}\nstartConsole();\n}})();\n'


def join_style() -> str:
    """All styles as one."""
    report = files("vfguide.lab.report").joinpath("page.css").read_text(encoding="utf-8")
    return "\n".join([report, read_replay("replay.css"), read_page("console.css")])


def read_page(name: str) -> str:
    """A file of the page."""
    return files("vfguide.lab.console").joinpath("page", name).read_text(encoding="utf-8")


class QuietServer(uvicorn.Server):
    """Leaves signals to its caller."""

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Capture none."""
        yield


def listen(address: Address) -> socket:
    """A socket that listens.

    Raises:
        InputError: the host is none of this computer, or the port is not to be had.
    """
    family = AF_INET6 if ":" in address.host else AF_INET
    opened = socket(family, SOCK_STREAM)
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
    source: Source, address: Address, *, title: str, token: str | None = None
) -> AsyncIterator[str]:
    """Serve a flight for as long as the context lasts.

    Args:
        source: the flight.
        address: where.
        title: what the page calls it.
        token: that lets in; one of chance if absent.

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
        app = application(
            source,
            title=title,
            token=token,
            cookie=f"vfguide-console-{port}",
            secure=address.certificate is not None,
        )
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


def configured(app: ASGIApp, address: Address) -> uvicorn.Config:
    """How the server runs.

    Raises:
        InputError: the certificate cannot be used.
    """
    config = uvicorn.Config(
        app,
        log_config=None,
        access_log=False,
        lifespan="off",
        http="h11",
        ws="none",
        limit_concurrency=MOST_CONNECTIONS,
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
