"""All plots of a flight, written as PNG files."""

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from matplotlib.figure import Figure

from vfguide.errors import InputError
from vfguide.lab.report.errors_plot import errors_figure, heights_figure
from vfguide.lab.report.picture import picture_of, save_figure
from vfguide.lab.report.separation_plot import separation_figure
from vfguide.lab.report.setpoints_plot import setpoints_figure
from vfguide.lab.report.style import NARROW_DOTS_PER_INCH
from vfguide.lab.report.tracks_plot import tracks_figure
from vfguide.lab.report.wind_plot import wind_figure
from vfguide.record.archive import WRITE_REMEDY
from vfguide.record.flight import FlightRecord


class Draw(Protocol):
    """What makes the figure of a plot."""

    def __call__(self, record: FlightRecord, *, narrow: bool = False) -> Figure:
        """The figure of a flight, laid out for a wide or a narrow screen."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Plot:
    """One of the plots of a report."""

    name: str
    """Name of the file, without its ending."""
    title: str
    """A heading."""
    caption: str
    """What to look for, in a sentence."""
    draw: Draw
    """Makes the figure."""
    needs_followers: bool
    """Whether there is nothing to draw for a lone leader."""


PLOTS = (
    Plot(
        name="tracks",
        title="Tracks",
        caption="The formation should keep one shape all along the dashed path, and seen from the "
        "leader each line should end in its cross and stay there.",
        draw=tracks_figure,
        needs_followers=False,
    ),
    Plot(
        name="errors",
        title="Formation errors",
        caption="The distance from the slot should fall below the dotted lines early and stay below the "
        "red one in the shaded window; below it, an error that keeps one sign is a bias, one that "
        "swings is a disturbance.",
        draw=errors_figure,
        needs_followers=True,
    ),
    Plot(
        name="setpoints",
        title="Setpoints",
        caption="The setpoint should be a smooth line just ahead of what the vehicle does: a band instead "
        "of a line is chatter, and red strips show where a limit of the vehicle cut it.",
        draw=setpoints_figure,
        needs_followers=False,
    ),
    Plot(
        name="heights",
        title="Heights",
        caption="In a climb all lines should bend at one time; below, an error that keeps one sign while "
        "they climb is a height delay that the mission tells wrong.",
        draw=heights_figure,
        needs_followers=True,
    ),
    Plot(
        name="separation",
        title="Separation",
        caption="No pair may come under the red line; look first at the time when the vehicles join.",
        draw=separation_figure,
        needs_followers=True,
    ),
    Plot(
        name="wind",
        title="Wind and Lyapunov function",
        caption="W should fall steeply while the vehicles join; where it rises again later, look for a "
        "change of wind or a cut setpoint at that time.",
        draw=wind_figure,
        needs_followers=False,
    ),
)


def plots_for(record: FlightRecord) -> tuple[Plot, ...]:
    """The plots that a record has something to show in; none for a flight that broke at once."""
    if record.time_s.size < 2 or record.time_s[-1] <= record.time_s[0]:
        return ()
    return tuple(plot for plot in PLOTS if record.followers or not plot.needs_followers)


def draw_narrow(plot: Plot, record: FlightRecord) -> bytes:
    """A plot for a narrow screen, as PNG."""
    return picture_of(plot.draw(record, narrow=True), NARROW_DOTS_PER_INCH)


def write_plots(record: FlightRecord, directory: Path) -> tuple[Path, ...]:
    """Draw all plots of a flight into a directory, which is made if need be.

    Raises:
        InputError: the directory cannot be written to.
    """
    try:
        directory.mkdir(parents=True, exist_ok=True)
        return tuple(
            save_figure(plot.draw(record), directory / f"{plot.name}.png")
            for plot in plots_for(record)
        )
    except OSError as error:
        raise InputError(
            f"{directory}: cannot be written: {error.strerror or error}; {WRITE_REMEDY}"
        ) from error
