"""Report as one self-contained HTML page, without network, other files or foreign scripts.

The page has one column; page and plots are light or dark as the reader's device is.
"""

import shlex
from base64 import b64encode
from collections.abc import Sequence
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined

from vfguide.lab.report.metrics import Handling, LeaderSummary, Summary, summarise
from vfguide.lab.report.plots import draw_narrow, plots_for, write_plots
from vfguide.lab.report.replay import hash_source, replay_of
from vfguide.lab.report.style import as_webp
from vfguide.lab.report.wording import (
    NOT_REQUIRED,
    compare,
    in_degrees,
    in_digits,
    in_percent,
    main_error,
    mean_in_digits,
    pace,
    response_words,
    setting,
    verdict,
    why_unjudged,
)
from vfguide.record.archive import writing_to
from vfguide.record.flight import FlightRecord
from vfguide.record.vehicle import VehicleRecord

NARROW = "(max-width: 40rem)"
"""Media query of screens with narrow plots: phones held upright."""

FOLD = (
    f'if (matchMedia("{NARROW}").matches)'
    ' document.querySelectorAll(".part ~ .part").forEach((part) => { part.open = false; });'
)
"""Script that folds all parts of the page but the first on narrow screens."""

STYLE = (Path(__file__).parent / "page.css").read_text(encoding="utf-8")


TEMPLATES = Environment(
    loader=PackageLoader("vfguide.lab.report", "."),
    autoescape=True,
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
    keep_trailing_newline=True,
)
"""Templates, escaped so that all content of missions and logs stays text."""

POLICY = (
    "default-src 'none'; img-src data:; style-src {style}; script-src {script}; "
    "base-uri 'none'; form-action 'none'"
)
"""Content security policy: the browser loads nothing, and runs only scripts with these hashes."""

VEHICLE_HEADINGS = (
    "Slot ahead, right, m",
    "Mean error, m",
    "95 %, m",
    "Greatest, m",
    "Along track, mean, m",
    "Across, mean, m",
)

HANDLING_HEADINGS = (
    "Course setpoints vary, rad/s",
    "of it not net turning, rad/s",
    "Speed setpoints vary, m/s²",
    "Roll rate, rms, °/s",
    "Setpoints cut by a limit",
    "At the greatest bank",
    "At the lowest or highest airspeed",
)


def write_report(record: FlightRecord, directory: Path) -> Path:
    """Write the plots and `report.html` into a directory, and return the path of the page.

    Raises:
        InputError: the directory cannot be written to.
    """
    pictures = write_plots(record, directory)
    page = directory / "report.html"
    text = render_page(record, summarise(record), pictures)
    with writing_to(page):
        page.write_text(text, encoding="utf-8")
    return page


def render_page(record: FlightRecord, summary: Summary, pictures: Sequence[Path]) -> str:
    """Return the whole page with embedded pictures."""
    replay, error = replay_of(record), in_digits(summary.formation.mean_error_m, "m")
    style = STYLE + replay.style
    script = f"{FOLD}\n{replay.script}"
    return TEMPLATES.get_template("page.html").render(
        title=f"{summary.mission}: {verdict(summary).lower()}",
        policy=POLICY.format(style=hash_source(style), script=hash_source(script)),
        style=style,
        script=script,
        replay=replay.markup,
        summary=summary,
        setting=setting(summary),
        pace=pace(summary),
        verdict=verdict(summary),
        praise="All that the mission asks for was reached."
        f" Mean formation error over the last half: {error}.",
        unjudged=f"{why_unjudged(summary).capitalize()}.",
        notes=record.notes,
        away=", ".join(one.name for one in record.followers if not one.in_formation.all()),
        figures=compare(summary) if len(summary.vehicles) > 1 else (),
        not_required=NOT_REQUIRED,
        headings=VEHICLE_HEADINGS,
        rows=[(one.name, _vehicle_cells(summary, one)) for one in record.vehicles],
        handling_headings=HANDLING_HEADINGS,
        handling=[(name, _handling_cells(one)) for name, one in summary.vehicles.items()],
        responses=[
            (name, words)
            for name, one in summary.vehicles.items()
            if (words := response_words(one)) is not None
        ],
        plots=[
            # Each plot has two layouts, for wide and for narrow screens.
            {
                "title": plot.title,
                "caption": plot.caption,
                "wide": b64encode(as_webp(picture.read_bytes())).decode("ascii"),
                "narrow": b64encode(as_webp(draw_narrow(plot, record))).decode("ascii"),
            }
            for plot, picture in zip(plots_for(record), pictures, strict=True)
        ],
        narrow=NARROW,
        command=reproduction_command(summary),
    )


def _vehicle_cells(summary: Summary, recorded: VehicleRecord) -> tuple[str, ...]:
    """Return a vehicle's cells in the order of `VEHICLE_HEADINGS`."""
    vehicle = summary.vehicles[recorded.name]
    slot = f"{recorded.slot_forward_m:g}, {recorded.slot_right_m:g}"
    if isinstance(vehicle, LeaderSummary):
        slot, along, across = "leads", "", ""
    else:
        along = mean_in_digits(vehicle.along_track_error_m)
        across = mean_in_digits(vehicle.cross_track_error_m)
    return (slot, *main_error(vehicle), along, across)


def _handling_cells(handling: Handling) -> tuple[str, ...]:
    """Return a vehicle's cells in the order of `HANDLING_HEADINGS`."""
    return (
        in_digits(handling.course_setpoint_variation_rad_s),
        in_digits(handling.course_setpoint_excess_variation_rad_s),
        in_digits(handling.speed_setpoint_variation_m_s2),
        in_degrees(handling.roll_rate_rad_s),
        in_percent(handling.limited_fraction),
        in_percent(handling.bank_limited_fraction),
        in_percent(handling.speed_limited_fraction),
    )


def reproduction_command(summary: Summary) -> str:
    """Return the command line that repeats the flight, with the mission in the folder `missions`."""
    words = ["vfguide", "fly", f"missions/{summary.mission}.yaml"]
    if summary.mode == "live":
        words.append("--live")
    words += ["--controller", summary.controller, "--plant", summary.plant]
    # Only the mission file can describe other winds.
    if summary.wind in ("calm", "article"):
        words += ["--wind", summary.wind]
    words += ["--duration", f"{summary.duration_s:g}", "--rate", f"{summary.rate_hz:g}"]
    words += ["--seed", str(summary.seed)]
    return shlex.join(words)
