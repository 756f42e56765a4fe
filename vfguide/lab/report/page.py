"""The report as one HTML page that needs nothing else: no network, no other file, no program but its own.

How the page looks: one column, light or dark as the reader's device is, plots too.
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
"""Screens for which plots are laid out anew: phones held upright."""

FOLD = (
    f'if (matchMedia("{NARROW}").matches)'
    ' document.querySelectorAll(".part ~ .part").forEach((part) => { part.open = false; });'
)
"""Folds every part of the page but the first, on such a screen."""

STYLE = (Path(__file__).parent / "page.css").read_text(encoding="utf-8")


TEMPLATES = Environment(
    loader=PackageLoader("vfguide.lab.report", "."),
    autoescape=True,
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
    keep_trailing_newline=True,
)
"""Whatever comes from a mission or a log stays text."""

POLICY = (
    "default-src 'none'; img-src data:; style-src {style}; script-src {script}; "
    "base-uri 'none'; form-action 'none'"
)
"""Forbids a browser to load anything from anywhere, and to run anything but what has these hashes."""

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
    """Write the plots and `report.html` into a directory; the path of the page.

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
    """The whole page, with the pictures inside it."""
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
            # In two layouts, for wide and for narrow screens.
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
    """The figures of a vehicle in the order of the headings."""
    vehicle = summary.vehicles[recorded.name]
    slot = f"{recorded.slot_forward_m:g}, {recorded.slot_right_m:g}"
    if isinstance(vehicle, LeaderSummary):
        slot, along, across = "leads", "", ""
    else:
        along = mean_in_digits(vehicle.along_track_error_m)
        across = mean_in_digits(vehicle.cross_track_error_m)
    return (
        slot,
        *main_error(vehicle),
        along,
        across,
    )


def _handling_cells(handling: Handling) -> tuple[str, ...]:
    """How hard a vehicle was flown, in the order of the headings."""
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
    """The command line, with the mission in the place where missions are kept."""
    words = ["vfguide", "fly", f"missions/{summary.mission}.yaml"]
    if summary.mode == "live":
        words.append("--live")
    words += ["--controller", summary.controller, "--plant", summary.plant]
    # Any other wind is described in the mission file alone.
    if summary.wind in ("calm", "article"):
        words += ["--wind", summary.wind]
    words += ["--duration", f"{summary.duration_s:g}", "--rate", f"{summary.rate_hz:g}"]
    words += ["--seed", str(summary.seed)]
    return shlex.join(words)
