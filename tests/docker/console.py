"""What a browser on this computer gets of a console in a container."""

import re
import time
import urllib.error
import urllib.request
from dataclasses import dataclass
from typing import Any

from tests.docker.formation import Formation
from tests.docker.programs import log_of
from tests.integration.console.streamed import aircraft_heard, logged_in

PATIENCE_S = 90.0
PRINTED = re.compile(r"console: (http://127\.0\.0\.1:\d+)/\?token=(\S+)")


@dataclass(frozen=True, slots=True, kw_only=True)
class Console:
    """What a browser finds at the address that the console has printed."""

    address: str
    """As printed, without the token."""
    refusal: int
    """HTTP status without the token."""
    page: bytes
    """With it."""
    heard: set[str]
    """Names of the aircraft that have a place in the flight that the page is sent."""
    published: Any
    """Where on this computer Docker publishes its port."""


def printed_address(formation: Formation) -> tuple[str, str]:
    """(address, token) that the console has printed; empty if it has printed none."""
    ends = time.monotonic() + PATIENCE_S
    while time.monotonic() < ends:
        if found := PRINTED.search(log_of(formation.container("console"))):
            return found.group(1), found.group(2)
        time.sleep(0.5)
    return "", ""


def look_at_console(formation: Formation) -> Console:
    """Open the page without the token and with it."""
    address, token = printed_address(formation)
    assert address, f"no address is printed: {log_of(formation.container('console'))}"
    refusal = 0
    try:
        urllib.request.build_opener().open(f"{address}/", timeout=20.0)
    except urllib.error.HTTPError as error:
        refusal = error.code
    visitor = logged_in(f"{address}/?token={token}")
    with visitor.open(f"{address}/", timeout=20.0) as page:
        content = page.read()
    _, heard = aircraft_heard(visitor, f"{address}/")
    ports = formation.inspect("console")["NetworkSettings"]["Ports"]
    return Console(
        address=address, refusal=refusal, page=content, heard=heard, published=ports["8080/tcp"]
    )
