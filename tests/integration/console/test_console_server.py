"""Who is let in by the console's server, and what it says with every answer."""

import asyncio
import http.client
import socket
import sqlite3
import ssl
from contextlib import AbstractAsyncContextManager, suppress
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from vfguide.commands.console import kept_token
from vfguide.errors import InputError
from vfguide.lab.console.server import ConsoleAddress, served
from vfguide.lab.console.source import MOST_PAGES, Source
from vfguide.lab.console.tiles import open_tiles

ANYWHERE = ConsoleAddress(port=0)

LOOKS, ORDERS = "t" * 24, "o" * 24
"""Tokens of those who look, and of those who give orders."""

Answer = tuple[int, http.client.HTTPMessage, str]


class Nothing(Source):
    """A flight without anything."""

    def opening(self) -> str:
        return '{"live": false}'


async def ask(
    url: str, path: str, *, cookie: str = "", method: str = "GET", authority: str = ""
) -> Answer:
    """Status, headers and the first bytes of what a path answers."""
    return await asyncio.to_thread(asked, url, path, cookie, method, authority)


def asked(url: str, path: str, cookie: str, method: str, authority: str) -> Answer:
    parts = urlsplit(url)
    assert parts.hostname is not None
    connection = http.client.HTTPConnection(parts.hostname, parts.port, timeout=60)
    if parts.scheme == "https":
        trusted = ssl.create_default_context(cafile=authority)
        connection = http.client.HTTPSConnection(
            parts.hostname, parts.port, timeout=60, context=trusted
        )
    connection.request(method, path, headers={"Cookie": cookie} if cookie else {})
    answer = connection.getresponse()
    found = answer.status, answer.headers, answer.read1(2000).decode(errors="replace")
    connection.close()
    return found


def when_served(
    address: ConsoleAddress = ANYWHERE, *, source: Source | None = None, orders: str | None = None
) -> AbstractAsyncContextManager[str]:
    """A console that is served."""
    found = source or Nothing()
    return served(found, address, title="<b>&", token=LOOKS, operator_token=orders)


PATHS = ("/", "/console.js", "/console.css", "/flight", "/nowhere")


@pytest.mark.parametrize("given", ["", "?token=", "?token=wrong", f"?token={LOOKS[1:]}"])
async def test_nothing_is_shown_without_the_token(given):
    async with when_served() as url:
        for path in PATHS:
            status, headers, text = await ask(url, path + given)
            assert status == 403
            assert "open the whole address" in text
            assert "set-cookie" not in headers
        wrong = f"vfguide-console-{urlsplit(url).port}=wrong"
        status, _, _ = await ask(url, "/flight", cookie=wrong)
        assert status == 403


async def test_the_token_gives_a_cookie_that_lets_in_and_leaves_the_address():
    async with when_served() as url:
        parts = urlsplit(url)
        status, headers, _ = await ask(url, f"/?{parts.query}")
        assert (status, headers["location"]) == (303, "/")
        cookie, *attributes = headers["set-cookie"].split("; ")
        assert {"HttpOnly", "SameSite=lax"} <= set(attributes)
        status, _, page = await ask(url, "/", cookie=cookie)
        assert status == 200
        assert "<h1>&lt;b&gt;&amp;</h1>" in page
        status, headers, text = await ask(url, "/flight", cookie=cookie)
        assert (status, headers["content-type"].split(";")[0]) == (200, "text/event-stream")
        assert text.startswith("event: flight\ndata: {")
        status, _, _ = await ask(url, "/", cookie=cookie, method="POST")
        assert status == 405


async def test_operators_have_a_token_of_their_own_and_a_cookie_that_no_other_site_can_use():
    async with when_served(orders=ORDERS) as url:
        page = url.partition("?")[0]
        assert url == f"{page}?token={LOOKS}"
        answers = [await ask(page, f"/?token={token}") for token in (LOOKS, ORDERS)]
        looks, orders = (headers.get_all("set-cookie", []) for _, headers, _ in answers)
        assert len(looks) == 1
        assert len(orders) == 2
        (own,) = (one for one in orders if "operator" in one)
        assert {"HttpOnly", "SameSite=strict"} <= set(own.split("; "))
        for cookies, first in ((looks, "event: flight"), (orders, "event: operator")):
            cookie = "; ".join(one.split("; ")[0] for one in cookies)
            _, _, text = await ask(url, "/flight", cookie=cookie)
            assert text.startswith(first)


async def test_every_answer_allows_the_pages_own_files_alone():
    async with when_served() as url:
        for path in (*PATHS, "/?" + urlsplit(url).query):
            _, headers, _ = await ask(url, path)
            policy = headers["content-security-policy"]
            assert "default-src 'none'" in policy
            assert "unsafe" not in policy
            assert "http" not in policy
            assert headers["cache-control"] == "no-store"
            assert headers["referrer-policy"] == "no-referrer"


@pytest.mark.parametrize("host", ["10.0.0.1", "::", "192.0.2.7", "ground.example"])
def test_beyond_this_computer_a_certificate_is_wanted(host):
    with pytest.raises(InputError, match="--certificate"):
        ConsoleAddress(host=host).check()


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.9", "::1", "localhost"])
def test_on_this_computer_none_is(host):
    ConsoleAddress(host=host).check()


async def test_with_a_certificate_it_is_served_by_tls(certificate):
    async with when_served(ConsoleAddress(port=0, **certificate)) as url:
        assert url.startswith("https://127.0.0.1:")
        query = urlsplit(url).query
        authority = str(certificate["certificate"])
        status, headers, _ = await ask(url, f"/?{query}", authority=authority)
        assert status == 303
        assert "Secure" in headers["set-cookie"]


async def test_a_certificate_that_is_none_is_one_line(tmp_path):
    wrong = tmp_path / "wrong.pem"
    wrong.write_text("nothing")

    with pytest.raises(InputError, match="cannot be used"):
        async with when_served(ConsoleAddress(port=0, certificate=wrong)):
            pytest.fail("served")


async def test_a_port_that_is_taken_is_one_line():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        with pytest.raises(InputError, match="choose another"):
            async with when_served(ConsoleAddress(port=taken.getsockname()[1])):
                pytest.fail("served")


async def test_more_pages_than_are_served_are_told_so_and_an_operator_is_still_let_in():
    async with when_served(orders=ORDERS) as url:
        host, port = urlsplit(url).hostname, urlsplit(url).port
        looks, orders = f"vfguide-console-{port}={LOOKS}", f"vfguide-operator-{port}={ORDERS}"
        request = f"GET /flight HTTP/1.1\r\nHost: {host}\r\nCookie: {looks}\r\n\r\n".encode()
        writers = []
        for _ in range(MOST_PAGES):
            reader, writer = await asyncio.open_connection(host, port)
            writer.write(request)
            assert b"200" in await reader.readline()
            await reader.readuntil(b"data: ")
            writers.append(writer)
        status, _, _ = await ask(url, "/flight", cookie=looks)
        assert status == 503
        both = f"{looks}; {orders}"
        status, _, text = await ask(url, "/flight", cookie=both)
        assert (status, text.partition("\n")[0]) == (200, "event: operator")
        for writer in writers:
            writer.close()


@pytest.mark.parametrize(
    "said", [b"", b"GET / HTTP/1.1\r\nHost: a\r\n", b"GET / HTTP/1.1\r\nHost: a\r\n\r\nGET"]
)
async def test_five_hundred_idle_connections_keep_nobody_out_and_end(said):
    async with when_served() as url:
        parts = urlsplit(url)
        idle = []
        for _ in range(500):
            reader, writer = await asyncio.open_connection(parts.hostname, parts.port)
            writer.write(said)
            idle.append((reader, writer))
        status, _, _ = await ask(url, f"/?{parts.query}")
        assert status == 303
        async with asyncio.timeout(60.0):
            for reader, writer in idle:
                with suppress(ConnectionError):
                    await reader.read()
                writer.close()


def test_a_token_that_is_kept_is_the_same_after_a_restart(tmp_path):
    file = tmp_path / "token"
    token = kept_token(file)
    assert file.stat().st_mode & 0o077 == 0
    assert kept_token(file) == token
    file.chmod(0o644)
    with pytest.raises(InputError, match="chmod 600"):
        kept_token(file)
    file.chmod(0o600)
    file.write_text("short\n")
    with pytest.raises(InputError, match="holds no token"):
        kept_token(file)


async def test_a_port_that_is_published_on_the_loopback_interface_alone_needs_no_certificate():
    published = ConsoleAddress(host="0.0.0.0", port=0, published="http://127.0.0.1:18080")  # noqa: S104
    async with when_served(published) as url:
        # What people open is the address outside, whatever it is served on inside.
        assert url == f"http://127.0.0.1:18080/?token={LOOKS}"


@pytest.mark.parametrize(
    "published",
    [
        "http://192.168.1.10:8080",
        "http://0.0.0.0:8080",
        "https://127.0.0.1:8080",
        "http://127.0.0.1.example:8080",
        "http://127.0.0.1:8080@example.com",
        "http://127.0.0.1:99999",
        "127.0.0.1:8080",
        "",
    ],
)
def test_only_this_computer_s_own_address_counts_as_published(published):
    with pytest.raises(InputError, match="--published"):
        ConsoleAddress(host="0.0.0.0", published=published).check()  # noqa: S104


def picture_file(path: Path) -> Path:
    """A map of one picture: the whole world at zoom 0."""
    file = sqlite3.connect(path)
    file.executescript(
        "CREATE TABLE metadata (name TEXT, value TEXT);"
        "CREATE TABLE tiles (zoom_level INTEGER, tile_column INTEGER, tile_row INTEGER, tile_data BLOB)"
    )
    file.execute("INSERT INTO tiles VALUES (0, 0, 0, ?)", (b"\xff\xd8\xffpicture",))
    file.commit()
    file.close()
    return path


async def test_tiles_are_for_who_has_the_token_and_the_page_may_show_pictures_only_with_a_map(
    tmp_path,
):
    source = Nothing()
    source.tiles = open_tiles(str(picture_file(tmp_path / "a.mbtiles")))
    async with when_served(source=source) as url:
        parts = urlsplit(url)
        status, headers, _ = await ask(url, "/tiles/0/0/0")
        assert status == 403
        cookie = f"vfguide-console-{parts.port}={LOOKS}"
        status, headers, text = await ask(url, "/tiles/0/0/0", cookie=cookie)
        assert (status, headers["content-type"]) == (200, "image/jpeg")
        assert headers["content-security-policy"].endswith("; img-src 'self'")
        for path in ("/tiles/1/0/0", "/tiles/0/0/9", "/tiles/-1/0/0", "/tiles/0/0/../../x"):
            status, _, text = await ask(url, path, cookie=cookie)
            assert status == 404, text
