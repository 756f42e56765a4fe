"""What a browser is sent of a flight, without one."""

import json
import time
import urllib.request
from collections.abc import Iterator
from http.client import HTTPResponse
from typing import Any

PATIENCE_S = 90.0
ANSWER_S = 20.0


def logged_in(address: str) -> urllib.request.OpenerDirector:
    """A visitor that has opened the whole address, with its token."""
    visitor = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
    visitor.open(address, timeout=ANSWER_S).read()
    return visitor


def events_of(stream: HTTPResponse) -> Iterator[dict[str, Any]]:
    """What is in an event stream, until a while has passed."""
    ends = time.monotonic() + PATIENCE_S
    while time.monotonic() < ends and (line := stream.readline()):
        name, _, content = line.partition(b": ")
        if name == b"data":
            yield json.loads(content)


def aircraft_heard(visitor: urllib.request.OpenerDirector, page: str) -> tuple[set[str], set[str]]:
    """Names of the aircraft of a flight, and of those that have a place in it, once all have or it is late.

    Args:
        visitor: of the page.
        page: its address, with a slash at its end.
    """
    names: list[str] = []
    place, heard = 0, set[str]()
    with visitor.open(f"{page}flight", timeout=ANSWER_S) as stream:
        for content in events_of(stream):
            if "vehicles" in content:
                names = [vehicle["name"] for vehicle in content["vehicles"]]
                place = content["names"].index("north_m")
            elif "v" in content:
                rows = zip(names, content["v"], strict=True)
                heard = {name for name, row in rows if row[place] is not None}
            if names and heard == set(names):
                break
    return set(names), heard
