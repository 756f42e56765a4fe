"""Plot of setpoints, measurements and the learned response."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from vfguide.elementwise import FloatArray
from vfguide.guidance.response import HoldResponse
from vfguide.identification.recording import Findings, HoldSamples, followed

TOLD, SEEN, MODELLED = "#9aa0a6", "#1a73e8", "#d93025"


def draw_findings(findings: Findings, path: Path, title: str) -> None:
    """Write the plot of a flight as PNG."""
    figure = Figure(figsize=(10.0, 7.0), layout="constrained")
    FigureCanvasAgg(figure)
    upper, lower = figure.subplots(2, 1)
    figure.suptitle(title)
    course, speed = findings.course_samples, findings.speed_samples
    if course is not None and findings.course is not None:
        draw(upper, course, findings.course, np.degrees)
        upper.set_ylabel("heading (setpoint: course), degrees")
        upper.set_title(words(findings.course, "alpha"), loc="left", fontsize=10)
    if speed is not None and findings.speed is not None:
        draw(lower, speed, findings.speed, np.asarray)
        lower.set_ylabel("speed, m/s")
        lower.set_title(words(findings.speed, "beta"), loc="left", fontsize=10)
    lower.set_xlabel("time, s")
    figure.savefig(path, dpi=110)


def draw(
    axes: Axes, samples: HoldSamples, found: HoldResponse, shown: Callable[[FloatArray], FloatArray]
) -> None:
    """Draw one stretch: setpoints as steps, the measurement and the model's response."""
    told, seen, modelled = map(shown, (samples.setpoint, samples.seen, followed(samples, found)))
    first, last = samples.time_s[0], samples.time_s[-1]
    near = samples.setpoint_s >= first
    near[max(int(np.argmax(near)) - 1, 0)] = True
    edges = np.append(np.maximum(samples.setpoint_s[near], first), last) - first
    axes.stairs(told[near], edges, color=TOLD, label="setpoint", baseline=None)
    axes.plot(samples.time_s - first, seen, color=SEEN, linewidth=1.6, label="flown")
    axes.plot(
        samples.time_s - first, modelled, color=MODELLED, linewidth=1.0, label="learned response"
    )
    axes.grid(visible=True, alpha=0.3)
    axes.legend(loc="upper right", fontsize=8)


def words(found: HoldResponse, name: str) -> str:
    """Return the numbers of a response as a title."""
    return (
        f"{name} {found.gain:.3f} ({found.least:.2f} to {found.greatest:.2f}) 1/s, dead time"
        f" {found.dead_time:.2f} s, lag {found.lag:.2f} s, together {found.earliest:.2f} to"
        f" {found.latest:.2f} s"
    )
