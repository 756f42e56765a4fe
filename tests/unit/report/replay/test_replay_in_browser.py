"""The replay in Chromium: what it shows at a moment, and how a reader's hands move it."""

import re
from collections.abc import Callable
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import FloatRect, Page

from tests.kit.records import still_flight, still_vehicle, with_vehicle
from vfguide.elementwise import FloatArray
from vfguide.lab.report.figures import slot_error
from vfguide.lab.report.page import write_report
from vfguide.record.events import FlightEvent
from vfguide.record.flight import FlightRecord, Outline, VehicleRecord

OpenPage = Callable[..., Page]
WritePage = Callable[[FlightRecord], Path]


def moment(page: Page) -> float:
    return float(page.get_by_label("Time", exact=True).input_value())


def cell(page: Page, row: str, column: int) -> str:
    """A number of the table; the leader's column is 0."""
    rows = page.locator("table.numbers tbody tr").filter(has_text=row)
    return rows.locator("td").nth(column).inner_text()


def ink(page: Page, part: str) -> int:
    """How many pixels of a canvas something is drawn on."""
    count: int = page.evaluate(
        """(part) => {
            const canvas = document.querySelector(`canvas[data-part="${part}"]`);
            const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
            let count = 0;
            for (let i = 3; i < data.length; i += 4) if (data[i] > 0) count += 1;
            return count;
        }""",
        part,
    )
    return count


def picture(page: Page, part: str) -> str:
    """All pixels of a canvas."""
    text: str = page.evaluate(
        "(part) => document.querySelector(`canvas[data-part='${part}']`).toDataURL()", part
    )
    return text


def player(page: Page, told: str, argument: object = None) -> Any:
    """What a function of JavaScript makes of the player, and of an argument."""
    program = f"(one) => ({told})(document.getElementById('replay').player, one)"
    return page.evaluate(program, argument)


def seek(page: Page, time_s: float) -> None:
    player(page, "(player, time) => player.seek(time)", time_s)


def box_of(page: Page, place: str) -> FloatRect:
    """Where a part of the page is, in pixels."""
    box = page.locator(place).bounding_box()
    assert box is not None
    return box


@pytest.fixture
def page(circle_flight: FlightRecord, open_page: OpenPage, write_page: WritePage) -> Page:
    return open_page(write_page(circle_flight))


def test_the_replay_begins_at_rest_and_draws_something(page):
    assert moment(page) == 0.0
    assert ink(page, "scene") > 5000
    assert ink(page, "timeline") > 5000
    page.clock.run_for(1000)
    assert moment(page) == 0.0


def test_playing_takes_the_time_that_it_says(page):
    page.get_by_role("button", name="Play").click()
    page.clock.run_for(3000)
    assert moment(page) == pytest.approx(3.0, abs=0.15)
    page.get_by_label("Speed", exact=True).select_option("10")
    page.clock.run_for(2000)
    assert moment(page) == pytest.approx(23.0, abs=0.5)
    page.get_by_role("button", name="Pause").click()
    before = moment(page)
    page.clock.run_for(2000)
    assert moment(page) == before


def test_playing_ends_at_the_end_and_begins_anew(page):
    seek(page, 299.0)
    page.get_by_role("button", name="Play").click()
    page.clock.run_for(3000)
    assert moment(page) == 300.0
    page.get_by_role("button", name="Play").click()
    page.clock.run_for(1000)
    assert moment(page) == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize("time_s", [0.0, 10.0, 200.0])
def test_the_table_has_the_numbers_of_the_moment(page, circle_flight, time_s):
    seek(page, time_s)
    follower = circle_flight.followers[1]
    sample = round(time_s * 20.0)
    error = slot_error(circle_flight.leader, follower)
    assert cell(page, "From the slot", 2) == f"{error.distance_m[sample]:.2f}"
    assert cell(page, "Airspeed", 2) == f"{follower.airspeed_m_s[sample]:.1f}"
    assert cell(page, "Height", 2) == "588.0"
    assert cell(page, "From the slot", 0) == "\u2013"
    assert cell(page, "Mode", 0).startswith("tracking")


def test_the_age_of_what_was_heard_is_shown_where_it_was_recorded(
    page, circle_flight, open_page, write_page
):
    plotted = page.get_by_label("Plotted quantity")
    assert page.get_by_role("row", name="Leader's state, s old").count() == 0
    assert "Age of the leader's state" not in plotted.inner_text()
    ages = np.where(circle_flight.time_s < 100.0, 0.12, 1.5)
    known = open_page(write_page(with_vehicle(circle_flight, "f1", leader_age_s=ages)))
    seek(known, 50.0)
    assert [cell(known, "Leader's state", column) for column in (0, 1)] == ["\u2013", "0.12"]
    seek(known, 200.0)
    assert cell(known, "Leader's state", 1) == "1.50"
    before = picture(known, "timeline")
    known.get_by_label("Plotted quantity").select_option("age")
    assert picture(known, "timeline") != before


def test_between_samples_aircraft_are_on_the_curve(page, circle_flight):
    """The replay knows every fourth sample; two steps after one of them the record knows better."""
    sample = 100 * 20 + 2
    state = player(page, "({ flight }) => flight.at(flight.leader, 100.1)")
    leader = circle_flight.leader
    assert state["north_m"] == pytest.approx(leader.north_m[sample], abs=0.02)
    assert state["east_m"] == pytest.approx(leader.east_m[sample], abs=0.02)


def test_keys_move_the_time_and_the_view(page):
    page.locator("#replay").focus()
    for key in ("ArrowRight", "ArrowRight", "Shift+ArrowRight", "ArrowLeft"):
        page.keyboard.press(key)
    assert moment(page) == pytest.approx(11.0)
    page.keyboard.press("End")
    assert moment(page) == 300.0
    page.keyboard.press("Home")
    page.keyboard.press("3")
    assert page.get_by_role("button", name="3D").get_attribute("aria-pressed") == "true"
    page.keyboard.press("Space")
    page.clock.run_for(500)
    assert moment(page) > 0.3


def test_everything_can_be_reached_with_the_tab_key(page):
    page.locator("#replay").focus()
    reached = set()
    for _ in range(20):
        page.keyboard.press("Tab")
        name = "document.activeElement.dataset.part ?? document.activeElement.textContent"
        reached.add(page.evaluate(name))
    assert {"play", "slider", "speed", "quantity", "span"} <= reached
    assert {"above", "course", "aslant", "whole", "f1"} <= reached


def test_a_press_on_the_plot_goes_to_its_time(page):
    page.locator("canvas.timeline").scroll_into_view_if_needed()
    box = box_of(page, "canvas.timeline")
    # The time axis lies between 48 pixels from the left and 12 from the right.
    middle = box["x"] + 48 + (box["width"] - 60) / 2
    page.mouse.move(middle, box["y"] + 60)
    page.mouse.down()
    assert moment(page) == pytest.approx(150.0, abs=1.0)
    page.mouse.move(middle + (box["width"] - 60) / 4, box["y"] + 90)
    page.mouse.up()
    assert moment(page) == pytest.approx(225.0, abs=1.0)


def test_each_view_and_quantity_draws_another_picture(page):
    seek(page, 20.0)
    views = set()
    for name in ("Above", "Course up", "3D", "Whole flight"):
        page.get_by_role("button", name=name, exact=True).click()
        views.add(picture(page, "scene"))
    assert len(views) == 4
    plotted, plots = page.get_by_label("Plotted quantity"), set()
    options = plotted.locator("option").evaluate_all("all => all.map(one => one.value)")
    for option in options:
        plotted.select_option(option)
        plots.add(picture(page, "timeline"))
    assert len(plots) == len(options) == 8


def test_dragging_turns_the_slanted_view_and_reset_undoes_it(page):
    page.get_by_role("button", name="3D").click()
    first = picture(page, "scene")
    box = box_of(page, "canvas[data-part=scene]")
    page.mouse.move(box["x"] + 600, box["y"] + 400)
    page.mouse.down()
    page.mouse.move(box["x"] + 500, box["y"] + 380)
    page.mouse.up()
    assert picture(page, "scene") != first
    page.get_by_role("button", name="Reset the view").click()
    assert picture(page, "scene") == first


def test_an_aircraft_that_is_pressed_is_chosen(page):
    seek(page, 100.0)
    place = player(
        page,
        """({ scene }) => {
            const { place } = scene.shown.find(({ vehicle }) => vehicle.name === "f2");
            const box = scene.canvas.getBoundingClientRect();
            return [box.left + place.x, box.top + place.y];
        }""",
    )
    page.mouse.click(*place)
    assert page.get_by_role("button", name="f2").get_attribute("aria-pressed") == "true"
    page.keyboard.press("Escape")
    page.locator("#replay").focus()
    page.keyboard.press("Escape")
    assert page.get_by_role("button", name="f2").get_attribute("aria-pressed") == "false"


def test_all_aircraft_and_slots_are_in_the_picture_all_the_time(page):
    outside = player(
        page,
        """(player) => {
            const outside = [];
            for (const view of ["above", "course", "aslant"]) {
                player.look(view);
                for (let time = 0; time <= 300; time += 5) {
                    player.seek(time);
                    const { camera, shown } = player.scene;
                    for (const { vehicle, place, slotPlace } of shown) {
                        for (const { x, y } of slotPlace ? [place, slotPlace] : [place]) {
                            const inside = x > 0 && y > 0 && x < camera.width && y < camera.height;
                            if (!inside) outside.push([view, time, vehicle.name]);
                        }
                    }
                }
            }
            return outside;
        }""",
    )
    assert outside == []


def test_changes_of_mode_can_be_walked_through(circle_flight, open_page, write_page):
    mode = np.where(circle_flight.time_s < 12.0, 1, 2)
    one = replace(circle_flight, vehicles=circle_flight.vehicles[:2])
    page = open_page(write_page(with_vehicle(one, "f1", mode=mode)))
    assert cell(page, "Mode", 1).startswith("joining")
    page.get_by_role("button", name="Next event").click()
    assert moment(page) == pytest.approx(12.0, abs=0.11)
    assert cell(page, "Mode", 1).startswith("tracking")
    page.get_by_role("button", name="Event before").click()
    assert moment(page) == 0.0


def test_events_are_reached_by_mark_list_and_key(circle_flight, open_page, write_page):
    events = (
        FlightEvent(time_s=12.0, vehicle="leader", kind="order", text="order 1 is <b>flown</b>"),
        FlightEvent(time_s=30.0, vehicle="f1", kind="text", text="take over", warning=True),
    )
    page = open_page(write_page(replace(circle_flight, events=events)))
    entries = page.locator("[data-part=events] button")
    # Names and texts of others stay text.
    assert "leader: order 1 is <b>flown</b>" in entries.nth(0).inner_text().replace("\n", " ")
    entries.nth(1).click()
    assert moment(page) == 30.0
    assert entries.nth(1).get_attribute("aria-current") == "true"
    page.get_by_role("button", name="Event before").click()
    assert moment(page) == 12.0
    place = player(
        page,
        """({ timeline }) => {
            const box = timeline.canvas.getBoundingClientRect();
            const x = timeline.xOf(30);
            for (let y = 0; y < box.height; y++)
                if (timeline.eventNear(x, y)) return [box.left + x + 4, box.top + y + 4];
        }""",
    )
    page.mouse.click(*place)
    assert moment(page) == 30.0


def test_the_path_that_is_flown_at_the_moment_is_the_one_that_is_drawn(
    circle_flight, open_page, write_page
):
    time_s = circle_flight.time_s
    number = np.select([time_s < 10.0, time_s < 20.0], [0.0, 1.0], np.nan)
    record = with_vehicle(circle_flight, "leader", path_number=number)
    east = Outline(kind="path", north_m=np.array([0.0, 0.0]), east_m=np.array([500.0, 700.0]))
    page = open_page(write_page(replace(record, outlines=(east,))))
    drawn = "({ flight }) => [flight.path.east_m.at(-1) ?? null, flight.outlines.length]"
    main = pytest.approx(float(circle_flight.path_east_m[-1]), abs=0.01)
    for moment_s, path, others in ((5.0, main, 1), (15.0, 700.0, 1), (25.0, None, 2)):
        seek(page, moment_s)
        assert player(page, drawn) == [path, others]


def test_the_page_is_usable_on_a_phone(circle_flight, open_page, write_page):
    page = open_page(write_page(circle_flight), phone=True)
    assert page.evaluate("document.documentElement.scrollWidth") == 390
    page.get_by_role("button", name="Play").tap()
    page.clock.run_for(2000)
    assert moment(page) == pytest.approx(2.0, abs=0.15)
    boxes = page.locator(".replay button:visible, .replay select:visible").evaluate_all(
        """all => all.map((one) => one.getBoundingClientRect())
            .map(({ width, height }) => Math.min(width, height))"""
    )
    assert min(boxes) >= 32, "a finger needs 32 pixels"
    box = box_of(page, "canvas.timeline")
    page.touchscreen.tap(box["x"] + 48 + (box["width"] - 60) / 2, box["y"] + 60)
    assert moment(page) == pytest.approx(150.0, abs=2.0)


def test_the_report_is_folded_on_a_phone_and_shows_the_narrow_plots(circle_report, open_page):
    page = open_page(circle_report, phone=True)
    assert page.evaluate("document.documentElement.scrollWidth") == 390
    assert page.evaluate("document.documentElement.scrollHeight") < 5000
    assert page.locator(".part[open] > summary").all_inner_texts() == ["The formation"]
    for part in page.locator(".part > summary").all()[1:]:
        part.tap()
    assert page.evaluate("document.documentElement.scrollWidth") == 390
    widths = page.locator(".plot img").evaluate_all("all => all.map((one) => one.naturalWidth)")
    assert widths == [874] * 6
    shown = page.locator(".plot img").evaluate_all(
        "all => all.map((one) => one.getBoundingClientRect()).flatMap(({ left, right }) => [left, right])"
    )
    assert min(shown) >= 0
    assert max(shown) <= 390


def brightness(page: Page, place: str) -> float:
    """Mean of what is really painted of an element, 0 black to 1 white."""
    shot = Image.open(BytesIO(page.locator(place).first.screenshot())).convert("L")
    return float(np.asarray(shot).mean()) / 255.0


@pytest.mark.parametrize("place", [".plot", "canvas[data-part=scene]", "canvas.timeline"])
def test_pictures_follow_dark_mode(circle_report, open_page, place):
    assert brightness(open_page(circle_report), place) > 0.85
    assert brightness(open_page(circle_report, dark=True), place) < 0.25


GUSTS = {
    **dict.fromkeys(("north_m", "east_m", "altitude_amsl_m", "airspeed_setpoint_m_s"), 0.7),
    **dict.fromkeys(("wind_north_m_s", "wind_east_m_s"), 1.5),
    "airspeed_m_s": 1.0,
    "bank_rad": 0.1,
    "course_setpoint_rad": 0.05,
}
"""Root mean square of the noise of a series."""


def shaken(vehicle: VehicleRecord, seed: int) -> VehicleRecord:
    """The same in rough air: a curve that fills its picture is the largest file."""
    random, smooth = np.random.default_rng(seed), np.ones(20) / 20**0.5

    def gusty(name: str) -> FloatArray:
        noise = random.normal(0.0, GUSTS[name], vehicle.north_m.size)
        values: FloatArray = getattr(vehicle, name) + np.convolve(noise, smooth, "same")
        return values

    return replace(vehicle, **{name: gusty(name) for name in GUSTS})


def test_the_report_of_four_aircraft_for_300_s_is_below_2_mb_also_in_rough_air(
    circle_flight, circle_report, tmp_path
):
    assert circle_report.stat().st_size < 2_000_000
    vehicles = tuple(shaken(one, seed) for seed, one in enumerate(circle_flight.vehicles))
    rough = write_report(replace(circle_flight, vehicles=vehicles), tmp_path)
    assert rough.stat().st_size < 2_000_000


def test_only_the_pages_own_script_runs(circle_flight, open_page, write_page, tmp_path):
    """Markup that got into the page by some fault would not run, nor load anything."""
    text = write_page(circle_flight).read_text(encoding="utf-8")
    foreign = (
        '<script>document.title = "foreign"</script>'
        '<img src="http://127.0.0.1:9/x" onerror="document.title=1">'
    )
    path = tmp_path / "foreign.html"
    path.write_text(text.replace("<main>", f"<main>{foreign}"), encoding="utf-8")
    told: list[str] = []
    page = open_page(path, told=told)
    assert page.title() == "circle-wind: accepted"
    assert page.locator(".part:not([open])").count() == 0, "folded on phones alone"
    assert moment(page) == 0.0
    assert len(told) == 3
    assert all("violates the following Content Security Policy" in one for one in told), told


def test_names_stay_text(open_page, write_page):
    name = '<img src=x onerror="document.title=1"></script><script>document.title=2</script>'
    time_s = np.arange(5.0)
    record = still_flight(
        time_s,
        still_vehicle(name, "leader", time_s),
        still_vehicle("</script>", "follower", time_s),
        mission=name,
        mode_names=("waiting", "joining", name),
    )
    page = open_page(write_page(record))
    assert page.title() == f"{name}: accepted"
    assert cell(page, "Mode", 0) == name
    assert page.locator("table.numbers button").first.inner_text() == name
    assert page.locator("main img").count() == 0


def test_moments_that_nobody_recorded_are_left_out(circle_flight, open_page, write_page):
    gap = (circle_flight.time_s > 50.0) & (circle_flight.time_s < 60.0)
    follower = circle_flight.followers[0]
    names = ("north_m", "east_m", "altitude_amsl_m", "course_rad", "airspeed_m_s")
    lost = {name: np.where(gap, np.nan, getattr(follower, name)) for name in names}
    one = replace(circle_flight, vehicles=circle_flight.vehicles[:2])
    page = open_page(write_page(with_vehicle(one, "f1", **lost)))
    seek(page, 55.0)
    assert cell(page, "Airspeed", 1) == "\u2013"
    shown = player(page, "({ scene }) => scene.shown.map((one) => one.vehicle.name)")
    assert shown == ["leader"]
    seek(page, 70.0)
    assert re.fullmatch(r"\d+\.\d", cell(page, "Airspeed", 1))


def test_an_hour_replays_and_scrolls(open_page, write_page):
    time_s = np.arange(0.0, 3600.1, 0.05)
    angle = time_s / 7.5
    vehicles = [
        still_vehicle(
            name,
            "follower" if number else "leader",
            time_s,
            north_m=150.0 * np.cos(angle) - 20.0 * number,
            east_m=150.0 * np.sin(angle),
            course_rad=angle + np.pi / 2.0,
        )
        for number, name in enumerate(("leader", "f1", "f2", "f3"))
    ]
    path = write_page(still_flight(time_s, *vehicles))
    assert path.stat().st_size < 2_000_000
    page = open_page(path)
    page.get_by_label("Length of the plot").select_option("60")
    page.get_by_label("Speed", exact=True).select_option("60")
    page.get_by_role("button", name="Play").click()
    page.clock.run_for(5000)
    assert moment(page) == pytest.approx(300.0, abs=3.0)
    begin, end = player(page, "({ timeline }) => [timeline.from, timeline.to]")
    assert end - begin == pytest.approx(60.0)
    assert begin <= moment(page) <= end
    assert "1:00:00" in page.locator("output").inner_text()
