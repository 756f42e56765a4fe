"""The files of the console's page, put together: what a browser gets of them."""

import re
from html import escape
from importlib.resources import files

from vfguide.lab.report.replay.page_part import SCRIPTS as SHARED_SCRIPTS
from vfguide.lab.report.replay.page_part import read as read_replay

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
