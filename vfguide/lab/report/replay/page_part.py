"""The replay as a part of the report's page: markup, style, data and the program that the page may run."""

from base64 import b64encode
from dataclasses import dataclass
from hashlib import sha256
from importlib.resources import files

from vfguide.lab.report.replay.data import replay_json
from vfguide.record.flight import FlightRecord

SCRIPTS = (
    "flight.js",
    "camera.js",
    "scene.js",
    "timeline.js",
    "events.js",
    "numbers.js",
    "player.js",
)
"""In the order in which they build on each other."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PagePart:
    """What a page takes in to show a replay; all empty where there is nothing to show."""

    style: str
    """For its style element."""
    markup: str
    """Where the replay stands."""
    script: str
    """The program, for the end of the page."""


NOTHING = PagePart(style="", markup="", script="")


def replay_of(record: FlightRecord) -> PagePart:
    """The replay of a flight; nothing for one that broke at once."""
    if record.time_s.size < 2 or record.time_s[-1] <= record.time_s[0]:
        return NOTHING
    markup = read("replay.html").replace("<!-- below -->\n", read("numbers.html"))
    data = f'<script type="application/json" id="replay-data">{replay_json(record)}</script>\n'
    return PagePart(
        style=read("replay.css"),
        markup=f"<h2>Replay</h2>\n{markup}{data}",
        script=program(),
    )


def program() -> str:
    """All scripts as one that leaves no names behind in the page."""
    whole = "\n".join(read(name) for name in SCRIPTS)
    return f'"use strict";\n(() => {{\n{whole}\nstartReplay();\n}})();\n'


def hash_source(content: str) -> str:
    """What a content security policy calls an inline script or style by: of exactly these bytes."""
    digest = b64encode(sha256(content.encode()).digest()).decode("ascii")
    return f"'sha256-{digest}'"


def read(name: str) -> str:
    """A file of this package."""
    return files(__package__).joinpath(name).read_text(encoding="utf-8")
