"""One position on its way to its setpoint: the files that it passes, as docs/architecture.md shows them."""

import re
import sys
from pathlib import Path
from types import FrameType

from tests.kit.companion import HEADING, Flight, new_flight
from tests.kit.missions import ROOT
from tests.kit.wire import number_of, parsed
from vfguide.companion.supervisor import Mode

PACKAGE = ROOT / "vfguide"


def files_to_the_setpoint(flight: Flight) -> list[str]:
    """The project's files that the next position report passes, in their order, down to the sent bytes."""
    now = flight.now + 0.1
    for data in flight.link(now):
        flight.companion.receive_link(data, now)
    said = flight.waiting + flight.autopilot.advance(now - flight.booted)
    position = next(one for one in parsed(said) if one.get_type() == "GLOBAL_POSITION_INT")
    files: list[str] = []

    def note(frame: FrameType, event: str, _: object) -> None:
        file = Path(frame.f_code.co_filename)
        if event == "call" and file.is_relative_to(PACKAGE):
            name = str(file.relative_to(PACKAGE))
            if name not in files:
                files.append(name)

    sys.setprofile(note)
    try:
        out = flight.companion.answer(bytes(position.get_msgbuf()), now)
    finally:
        sys.setprofile(None)
    assert HEADING in [number_of(one) for one in parsed(out.to_autopilot)]
    return files


def test_the_documentation_shows_every_file_from_a_position_to_its_setpoint():
    flight = new_flight(until_s=60.0)
    assert flight.companion.snapshot.mode is Mode.TRACKING
    files = files_to_the_setpoint(flight)
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    table = (
        page.split("## From a position to its setpoint")[1].split("|---|---|")[1].split("\n\n")[0]
    )
    assert f"({len(files)}; " in page
    assert re.findall(r"`([a-z_0-9/]+\.py)`", table) == files, "\n".join(files)
