"""Formations are drawn in their shape, plots are written for every kind of flight."""

import math
from dataclasses import replace

import numpy as np
import pytest
from matplotlib import _pylab_helpers
from matplotlib.figure import Figure
from PIL import Image

from tests.kit.records import still_flight, still_follower, still_leader, still_vehicle
from vfguide.commands.output import PLOT_NAMES
from vfguide.errors import InputError
from vfguide.lab.report.errors_plot import errors_figure
from vfguide.lab.report.plots import PLOTS, direction_for_drawing, plots_for, write_plots
from vfguide.lab.report.style import save_figure, with_palette
from vfguide.lab.report.tracks_plot import (
    choose_magnification,
    choose_side,
    choose_snapshots,
    choose_view,
    draw_top_view,
    formation_links,
)
from vfguide.record.flight import Outline, RecordAcceptance


@pytest.mark.parametrize(
    ("others", "links"),
    [
        # A diamond has four sides, a V two arms.
        ([(-20.0, -20.0), (20.0, -20.0), (0.0, -40.0)], {(0, 1), (0, 2), (1, 3), (2, 3)}),
        (
            [(-20.0, -20.0), (20.0, -20.0), (-40.0, -40.0), (40.0, -40.0)],
            {(0, 1), (0, 2), (1, 3), (2, 4)},
        ),
    ],
)
def test_a_formation_is_drawn_in_its_shape(others, links):
    assert set(formation_links([(0.0, 0.0), *others])) == links


def test_wind_toward_the_west_is_drawn_at_270_and_still_air_has_no_direction():
    west, still = direction_for_drawing(np.zeros(2), np.array([-3.0, 0.01]))
    assert west == pytest.approx(270.0)
    assert math.isnan(still)


def test_a_wind_that_passes_north_is_not_drawn_across_the_plot():
    toward = np.radians([350.0, 358.0, 2.0, 10.0])
    drawn = direction_for_drawing(5.0 * np.cos(toward), 5.0 * np.sin(toward))
    assert np.isnan(drawn).tolist() == [False, True, False, False]


def test_a_formation_is_magnified_on_a_long_line_and_not_on_a_small_circle(circle_flight):
    time_s = np.arange(301.0)
    vehicles = [still_leader(time_s, north_m=20.0 * time_s)]
    vehicles.append(still_follower(time_s, north_m=20.0 * time_s - 20.0, slot_forward_m=-20.0))
    line = still_flight(time_s, *vehicles, path_north_m=np.array([0.0, 6000.0]))
    assert choose_magnification(line, choose_view(line)) > 5.0
    assert choose_magnification(circle_flight, choose_view(circle_flight)) == 1.0


def test_wind_arrows_are_drawn_inside_a_clockwise_circle(circle_flight):
    """Clockwise, the inside is on the right."""
    samples = choose_snapshots(circle_flight, 80.0)
    assert choose_side(circle_flight, samples, choose_view(circle_flight)) == 1.0


def test_drawn_formations_keep_clear_of_each_other(circle_flight):
    samples = list(choose_snapshots(circle_flight, 80.0))
    leader = circle_flight.leader
    places = np.column_stack((leader.north_m[samples], leader.east_m[samples]))
    gaps = [math.dist(a, b) for i, a in enumerate(places) for b in places[:i]]
    assert len(samples) > 3
    assert min(gaps) >= 80.0
    assert samples[0] == circle_flight.time_s.size - 1


def test_all_plots_of_a_flight_are_small_pictures(circle_flight, circle_report):
    pictures = [circle_report.parent / f"{plot.name}.png" for plot in plots_for(circle_flight)]
    assert len(pictures) == 6
    for picture in pictures:
        assert picture.read_bytes().startswith(b"\x89PNG")
        assert picture.stat().st_size < 300_000


def test_a_lone_leader_in_calm_air_is_drawn(tmp_path):
    paths = write_plots(still_flight(np.arange(3.0)), tmp_path)
    assert [path.name for path in paths] == ["tracks.png", "setpoints.png", "wind.png"]
    left = _pylab_helpers.Gcf.get_all_fig_managers()
    assert not left, "a figure is left in pyplot's global state"


def test_a_perfect_flight_with_names_like_formulas_is_drawn(tmp_path):
    """Errors of exactly zero have no logarithm, and dollar signs no meaning."""
    time_s = np.arange(3.0)
    leader = still_vehicle("$\\frac$", "leader", time_s)
    follower = still_vehicle("_f$1", "follower", time_s)
    assert len(write_plots(still_flight(time_s, leader, follower), tmp_path)) == 6


def test_states_that_are_not_known_are_left_out_of_the_drawing(circle_flight, tmp_path):
    leader, follower = circle_flight.leader, circle_flight.followers[0]
    unknown = np.full_like(circle_flight.time_s, math.nan)
    leader = replace(leader, north_m=unknown, wind_north_m_s=unknown)
    follower = replace(follower, lyapunov=unknown, course_setpoint_rad=unknown)
    broken = replace(circle_flight, vehicles=(leader, follower))
    assert len(write_plots(broken, tmp_path)) == 6


@pytest.mark.parametrize("samples", [0, 1])
def test_a_flight_that_broke_at_once_has_no_plots(samples):
    assert plots_for(still_flight(np.arange(float(samples)))) == ()


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("required_m", [0.05, 1e6])
def test_a_limit_far_from_every_error_leaves_room_for_the_axes(tmp_path, required_m):
    """As of a flight that ended at once, long before anybody was near a slot."""
    time_s = np.arange(3.0)
    vehicles = still_leader(time_s), still_follower(time_s, north_m=np.full(3, -60.0))
    limits = RecordAcceptance(mean_error_m=required_m)
    begun = still_flight(time_s, *vehicles, acceptance=limits)
    save_figure(errors_figure(begun), tmp_path / "errors.png")


def test_a_directory_that_cannot_be_made_is_an_input_error(tmp_path):
    (tmp_path / "taken").write_text("a file")
    with pytest.raises(InputError, match="cannot be written"):
        write_plots(still_flight(np.arange(3.0)), tmp_path / "taken")


def test_a_palette_keeps_the_background_and_a_thin_line_as_they_are():
    """White everywhere, a faint tint of ten rows, one blue pixel, and many other colours."""
    pixels = np.full((100, 100, 3), 255, dtype=np.uint8)
    pixels[:10] = (238, 243, 230)
    pixels[50, 50] = (0, 114, 178)
    pixels[90, :, :] = np.arange(100, dtype=np.uint8)[:, None] * 2
    pixels[91, :, 0] = np.arange(100, dtype=np.uint8) * 2
    reduced = np.asarray(with_palette(Image.fromarray(pixels)).convert("RGB")).astype(int)
    assert reduced[30, 30].tolist() == [255, 255, 255]
    assert reduced[5, 5].tolist() == [238, 243, 230]
    assert np.abs(reduced[50, 50] - (0, 114, 178)).max() <= 8


def test_a_flight_replaces_its_own_plots_and_no_other_file():
    # What a directory may hold of a flight is known without what draws it.
    assert {plot.name for plot in PLOTS} == set(PLOT_NAMES)


def test_the_legend_names_fence_and_other_paths_once():
    corner = np.array([0.0, 50.0])
    lines = [Outline(kind=kind, north_m=corner, east_m=corner) for kind in ("fence", "fence")]
    lines.append(Outline(kind="path", north_m=corner, east_m=corner))
    axes = Figure().subplots()
    draw_top_view(axes, still_flight(np.arange(3.0), outlines=tuple(lines)))
    labels = axes.get_legend_handles_labels()[1]
    assert [labels.count(one) for one in ("fence", "other paths", "path")] == [1, 1, 1]


def test_a_fence_far_away_leaves_the_flight_to_be_seen():
    # The drawn path is 100 m long: the view takes in 30 m of the fence to each side of it.
    far = np.array([-9000.0, 9000.0])
    edge = Outline(kind="fence", north_m=far, east_m=far)
    view = choose_view(still_flight(np.arange(3.0), outlines=(edge,)))
    assert (view.north_m, view.east_m) == pytest.approx((50.0, 0.0))
    assert view.side_m == pytest.approx(1.22 * 160.0)
