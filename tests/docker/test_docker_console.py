"""The console in a container: its page opens on this computer, and with the token alone."""

import re
import socket
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.docker.formation import Formation
from tests.docker.programs import log_of

PATIENCE_S = 90.0
PRINTED = re.compile(r"console: (http://127\.0\.0\.1:\d+)/\?token=(\S+)")


@pytest.fixture
def port() -> int:
    """A TCP port of the loopback interface that nobody uses."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.fixture
def formation(
    compose: tuple[str, ...], image: dict[str, Any], port: int, tmp_path: Path
) -> Iterator[Formation]:
    """A broker, keys and the console: as much as it takes to look."""
    assert image
    settings = {"COMPOSE_PROFILES": "demo,console", "CONSOLE_PORT": str(port)}
    made = Formation(compose, "console", tmp_path, settings)
    try:
        made.compose("up", "--detach", "console")
        yield made
    finally:
        made.remove()


def printed_address(formation: Formation) -> tuple[str, str]:
    """(address, token) that the console has printed."""
    ends = time.monotonic() + PATIENCE_S
    while time.monotonic() < ends:
        if found := PRINTED.search(log_of(formation.container("console"))):
            return found.group(1), found.group(2)
        time.sleep(0.5)
    pytest.fail(f"no address is printed: {log_of(formation.container('console'))}")


def test_the_printed_address_opens_the_page_and_no_other_does(
    formation: Formation, port: int
) -> None:
    address, token = printed_address(formation)
    assert address == f"http://127.0.0.1:{port}"
    with pytest.raises(urllib.error.HTTPError, match="403"):
        urllib.request.build_opener().open(f"{address}/", timeout=20.0)
    opener = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
    with opener.open(f"{address}/?token={token}", timeout=20.0) as page:
        assert b"circle-wind" in page.read()
    published = formation.inspect("console")["NetworkSettings"]["Ports"]["8080/tcp"]
    assert published == [{"HostIp": "127.0.0.1", "HostPort": str(port)}]
