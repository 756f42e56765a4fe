"""The report as one HTML page that needs nothing else: no network, no other file, no program but its own.

How the page looks: one column, light or dark as the reader's device is, plots too.
"""

import shlex
from base64 import b64encode
from collections.abc import Sequence
from html import escape
from pathlib import Path

from vfguide.errors import InputError
from vfguide.lab.report.metrics import summarise
from vfguide.lab.report.plots import Plot, draw_narrow, plots_for, write_plots
from vfguide.lab.report.replay.page_part import hash_source, replay_of
from vfguide.lab.report.summary import LeaderSummary, Summary
from vfguide.lab.report.wording import (
    NOT_REQUIRED,
    ComparedFigure,
    compare,
    in_digits,
    in_percent,
    main_error,
    mean_in_digits,
    pace,
    setting,
    verdict,
)
from vfguide.record.archive import WRITE_REMEDY
from vfguide.record.flight import FlightRecord

NARROW = "(max-width: 40rem)"
"""Screens for which plots are laid out anew: phones held upright."""

STYLE = """
:root {
  color-scheme: light dark;
  --text: #1c1e21; --quiet: #5c6370; --ground: #f6f7f8; --card: #ffffff; --rule: #dfe2e6;
  --good: #16713a; --good-ground: #e3f4e8; --bad: #a8131f; --bad-ground: #fbe6e7;
}
@media (prefers-color-scheme: dark) {
  :root {
    --text: #e6e7e9; --quiet: #a0a6b0; --ground: #15171a; --card: #1e2125; --rule: #363b42;
    --good: #7fd99a; --good-ground: #16301f; --bad: #ff9aa0; --bad-ground: #3a1a1d;
  }
}
* { box-sizing: border-box; }
body {
  margin: 0; background: var(--ground); color: var(--text);
  font: 16px/1.5 system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif;
}
main { max-width: 70rem; margin: 0 auto; padding: 1.5rem 1rem 4rem; }
h1 { font-size: 1.7rem; line-height: 1.2; margin: 0 0 .25rem; overflow-wrap: anywhere; }
h2 { font-size: 1.2rem; margin: 2.2rem 0 .6rem; }
p { margin: .4rem 0; }
.quiet { color: var(--quiet); }
.verdict { border-radius: .6rem; padding: .9rem 1.1rem; margin: 1.2rem 0; }
.verdict strong { font-size: 1.25rem; }
.verdict ul { margin: .4rem 0 0; padding-left: 1.2rem; }
.accepted { background: var(--good-ground); color: var(--good); }
.rejected { background: var(--bad-ground); color: var(--bad); }
.good { color: var(--good); font-weight: 600; }
.bad { color: var(--bad); font-weight: 600; }
.wide { overflow-x: auto; background: var(--card); border: 1px solid var(--rule); border-radius: .6rem; }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }
th, td { padding: .45rem .8rem; text-align: left; border-bottom: 1px solid var(--rule); }
th { font-weight: 600; font-size: .85rem; color: var(--quiet); vertical-align: bottom; }
tbody tr:last-child > * { border-bottom: 0; }
tbody th { color: var(--text); font-size: 1rem; font-weight: 500; }
td.number, th.number { text-align: right; white-space: nowrap; }
thead th.number { white-space: normal; }
figure { margin: 0 0 1.8rem; }
figcaption { margin: .5rem .2rem; color: var(--quiet); }
.plot { background: #fff; border: 1px solid var(--rule); border-radius: .6rem; padding: .6rem; }
.plot img { display: block; width: 100%; height: auto; }
/* Light and dark change places, and hues stay what they are. */
@media screen and (prefers-color-scheme: dark) {
  .plot { filter: invert(.88) hue-rotate(180deg); border-color: #dfe2e6; }
}
pre {
  white-space: pre-wrap; overflow-wrap: anywhere;
  background: var(--card); border: 1px solid var(--rule); border-radius: .6rem;
  padding: .8rem 1rem; font: .9rem/1.5 ui-monospace, "DejaVu Sans Mono", monospace;
}
@media (max-width: 40rem) {
  th, td { padding: .35rem .4rem; } .few td.number { white-space: normal; } .plot { padding: .15rem; }
}
@media print { figure { break-inside: avoid; } }
"""


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
    "Setpoint variation, rad/s",
    "of it not net turning, rad/s",
    "Cut by limits",
)


def write_report(record: FlightRecord, directory: Path) -> Path:
    """Write the plots and `report.html` into a directory; the path of the page.

    Raises:
        InputError: the directory cannot be written to.
    """
    pictures = write_plots(record, directory)
    page = directory / "report.html"
    text = render_page(record, summarise(record), pictures)
    try:
        page.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(
            f"{page}: cannot be written: {error.strerror or error}; {WRITE_REMEDY}"
        ) from error
    return page


def render_page(record: FlightRecord, summary: Summary, pictures: Sequence[Path]) -> str:
    """The whole page, with the pictures inside it."""
    plots = "".join(
        _render_plot(record, plot, picture)
        for plot, picture in zip(plots_for(record), pictures, strict=True)
    )
    replay = replay_of(record)
    style = STYLE + replay.style
    body = "".join(
        (
            f"<h1>{escape(summary.mission)}</h1>",
            f'<p class="quiet">{escape(setting(summary))}, {escape(pace(summary))}</p>',
            _render_verdict(summary),
            _render_notes(record),
            replay.markup,
            _render_figures(summary),
            _render_vehicles(record, summary),
            plots,
            "" if summary.mode == "recorded" else _render_reproduction(summary),
        )
    )
    policy = POLICY.format(
        style=hash_source(style), script=hash_source(replay.script) if replay.script else "'none'"
    )
    script = f"<script>{replay.script}</script>\n" if replay.script else ""
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{escape(policy, quote=True)}">\n'
        f"<title>{escape(summary.mission)}: {verdict(summary).lower()}</title>\n"
        f"<style>{style}</style>\n</head>\n<body>\n<main>\n{body}</main>\n{script}</body>\n</html>\n"
    )


def _render_verdict(summary: Summary) -> str:
    """The outcome, first of all, with every reason against it."""
    if summary.accepted:
        words = _words_of_praise(summary)
        return (
            f'<div class="verdict accepted"><strong>{verdict(summary)}</strong>'
            f"<p>{escape(words)}</p></div>\n"
        )
    reasons = "".join(f"<li>{escape(reason)}</li>" for reason in summary.rejections)
    return (
        f'<div class="verdict rejected"><strong>{verdict(summary)}</strong>'
        f"<ul>{reasons}</ul></div>\n"
    )


def _render_notes(record: FlightRecord) -> str:
    """Where the figures come from, if a reader has to know more than that they are true."""
    if not record.notes:
        return ""
    notes = "".join(f"<li>{escape(note)}</li>" for note in record.notes)
    return f"<h2>Where this comes from</h2>\n<ul>{notes}</ul>\n"


def _words_of_praise(summary: Summary) -> str:
    """What an accepted flight reached."""
    if len(summary.vehicles) < 2:
        return "A leader alone: nothing is asked of a formation."
    error = in_digits(summary.formation.mean_error_m, "m")
    return f"All that the mission asks for was reached. Mean formation error over the last half: {error}."


def _render_figures(summary: Summary) -> str:
    """The formation's figures beside what is required; nothing without followers."""
    if len(summary.vehicles) < 2:
        return ""
    begin, end = summary.formation.window_s
    rows = "".join(_render_figure(figure) for figure in compare(summary))
    states = "the autopilots' estimates" if summary.mode == "recorded" else "true states"
    return (
        "<h2>The formation</h2>\n"
        f'<p class="quiet">Errors are of all followers, on {states}, from {begin:g} to {end:g} s.</p>\n'
        '<div class="wide few"><table><thead><tr><th>Figure</th><th class="number">Measured</th>'
        '<th class="number">Required</th><th>Met</th></tr></thead>'
        f"<tbody>{rows}</tbody></table></div>\n"
    )


def _render_figure(figure: ComparedFigure) -> str:
    """One figure of the formation."""
    met = {
        True: '<span class="good">yes</span>',
        False: '<span class="bad">no</span>',
        None: "",
    }[figure.met]
    quiet = " quiet" if figure.required == NOT_REQUIRED else ""
    return (
        f'<tr><th scope="row">{escape(figure.name)}</th>'
        f'<td class="number">{escape(figure.measured)}</td>'
        f'<td class="number{quiet}">{escape(figure.required)}</td><td>{met}</td></tr>'
    )


def _render_vehicles(record: FlightRecord, summary: Summary) -> str:
    """A row of figures for each vehicle."""
    headings = "".join(f'<th class="number">{escape(name)}</th>' for name in VEHICLE_HEADINGS)
    rows = "".join(
        f'<tr><th scope="row">{escape(vehicle.name)}</th>'
        + "".join(
            f'<td class="number">{escape(cell)}</td>'
            for cell in _vehicle_cells(
                summary, vehicle.name, f"{vehicle.slot_forward_m:g}, {vehicle.slot_right_m:g}"
            )
        )
        + "</tr>"
        for vehicle in record.vehicles
    )
    return (
        "<h2>Each vehicle</h2>\n"
        '<p class="quiet">A slot is ahead and to the right of the leader. The leader\'s error is its '
        "distance from the path, a follower's its distance from the slot.</p>\n"
        f'<div class="wide"><table><thead><tr><th>Vehicle</th>{headings}</tr></thead>'
        f"<tbody>{rows}</tbody></table></div>\n"
    )


def _vehicle_cells(summary: Summary, name: str, slot: str) -> tuple[str, ...]:
    """The figures of a vehicle in the order of the headings."""
    vehicle = summary.vehicles[name]
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
        in_digits(vehicle.course_setpoint_variation_rad_s),
        in_digits(vehicle.course_setpoint_excess_variation_rad_s),
        in_percent(vehicle.limited_fraction),
    )


def _render_plot(record: FlightRecord, plot: Plot, picture: Path) -> str:
    """A plot inside the page, in another layout for a narrow screen, with what to look for."""
    wide = b64encode(picture.read_bytes()).decode("ascii")
    narrow = b64encode(draw_narrow(plot, record)).decode("ascii")
    return (
        f"<h2>{escape(plot.title)}</h2>\n<figure>"
        f'<div class="plot"><picture><source media="{NARROW}" srcset="data:image/png;base64,{narrow}">'
        f'<img alt="{escape(plot.title)}" src="data:image/png;base64,{wide}"></picture></div>'
        f"<figcaption>{escape(plot.caption)}</figcaption></figure>\n"
    )


def _render_reproduction(summary: Summary) -> str:
    """The command that flies this again."""
    again = (
        "Over real sockets no two flights are alike to the last digit."
        if summary.mode == "live"
        else "The same mission file and seed give the same flight to the last digit."
    )
    return (
        "<h2>Fly it again</h2>\n"
        f"<pre>{escape(reproduction_command(summary))}</pre>\n"
        f'<p class="quiet">{again}</p>\n'
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
