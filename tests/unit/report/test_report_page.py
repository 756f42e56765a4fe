"""The page stands alone and says the verdict first; the terminal says the same."""

import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from tests.kit.records import still_flight, still_follower, still_leader, still_vehicle
from vfguide.lab.report import plots
from vfguide.lab.report.metrics import summarise
from vfguide.lab.report.page import reproduction_command, write_report
from vfguide.lab.report.wording import in_digits, summary_table
from vfguide.record.flight import FlightRecord, RecordAcceptance
from vfguide.record.vehicle import SLOT_SERIES

STRICT = RecordAcceptance(mean_error_m=0.001, min_separation_m=5.0)


class Outline(HTMLParser):
    """Tags, references and text of a page, and whether its tags pair up."""

    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.references: list[str] = []
        self.open: list[str] = []
        self.text = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        places = {"src", "href", "srcset", "data"}
        self.references += [value or "" for name, value in attrs if name in places]
        if tag not in {"meta", "img", "source", "input"}:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


@pytest.fixture(scope="module")
def page(circle_report: Path) -> str:
    return circle_report.read_text(encoding="utf-8")


def read(page: str) -> Outline:
    outline = Outline()
    outline.feed(page)
    assert outline.open == []
    return outline


def test_the_page_refers_to_nothing_outside_itself(page):
    outline = read(page)
    assert len(outline.references) == 12, "each plot for a wide and for a narrow screen"
    assert all(reference.startswith("data:image/webp;base64,") for reference in outline.references)
    assert not re.search(r"https?://|@import|url\(", page)
    assert not {"link", "iframe", "object"} & set(outline.tags)


def test_the_page_follows_the_readers_device(page):
    assert 'name="viewport"' in page
    assert "prefers-color-scheme: dark" in page


def test_the_verdict_comes_before_every_figure(page):
    text = read(page).text
    assert text.index("Accepted") < text.index("Mean formation error")


def test_every_plot_has_a_caption(page):
    tags = read(page).tags
    assert tags.count("figcaption") == tags.count("img") == 6


HOSTILE = '<script>alert("1")</script>&'


@pytest.fixture
def one_plot(monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw the tracks alone: all plots are in `page`."""
    monkeypatch.setattr(plots, "PLOTS", plots.PLOTS[:1])


@pytest.fixture
def rejected_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Of a flight whose names are markup and whose two vehicles are in one place."""
    monkeypatch.setattr(plots, "PLOTS", plots.PLOTS[:1])
    time_s = np.arange(3.0)
    vehicles = still_vehicle(HOSTILE, "leader", time_s), still_vehicle("<b>", "follower", time_s)
    names = {"mission": HOSTILE, "controller": HOSTILE, "wind": "</style>"}
    limits = RecordAcceptance(min_separation_m=5.0)
    record = still_flight(time_s, *vehicles, **names, acceptance=limits)
    return write_report(record, tmp_path).read_text(encoding="utf-8")


def test_a_rejected_flight_says_why_at_the_top(rejected_page):
    text = read(rejected_page).text
    reason = "two vehicles came within 0 m of each other, closer than 5 m"
    assert text.index("Not accepted") < text.index(reason) < text.index("Mean formation error")


@pytest.mark.usefixtures("one_plot")
def test_the_page_says_who_did_not_come_to_its_slot_and_how_hard_it_was_flown(tmp_path):
    time_s = np.arange(11.0)
    banks = np.radians(np.where(time_s % 2 > 0, 8.0, 0.0))
    rolling = still_follower(time_s, north_m=time_s * 0.0 - 30.0, bank_rad=banks)
    vehicles = still_leader(time_s), rolling
    flight = still_flight(time_s, *vehicles, acceptance=RecordAcceptance())
    text = read(write_report(flight, tmp_path).read_text(encoding="utf-8")).text
    assert "Not accepted" in text
    assert "All that the mission asks for was reached" not in text
    assert "f1 was 30 m from its slot in the last half" in text
    assert text.index("Roll rate, rms, °/s") < text.index("8.00")


def test_names_cannot_break_out_of_the_page(rejected_page):
    outline = read(rejected_page)
    assert outline.tags.count("script") == 2, "the replay's numbers and its program"
    assert "b" not in outline.tags
    assert HOSTILE in outline.text


@pytest.mark.usefixtures("one_plot")
def test_the_page_names_who_was_ordered_out_of_the_formation_and_is_in_no_figure_meanwhile(
    page, tmp_path
):
    time_s = np.arange(11.0)
    slots = {name: np.where(time_s > 5.0, np.nan, 0.0) for name in SLOT_SERIES}
    left = still_vehicle("<b>f1", "follower", time_s, **slots)
    flight = still_flight(time_s, still_leader(time_s), left)
    found = write_report(flight, tmp_path).read_text(encoding="utf-8")
    sentence = "without <b>f1 while ordered out of the formation."
    assert sentence in read(found).text
    assert "while ordered out" not in read(page).text


def test_a_flight_that_broke_at_once_still_has_a_page(tmp_path):
    outline = read(write_report(still_flight(np.array([])), tmp_path).read_text(encoding="utf-8"))
    assert "img" not in outline.tags


def test_the_flight_can_be_flown_again_from_the_page(circle_flight, page):
    command = reproduction_command(summarise(circle_flight))
    assert command == (
        "vfguide fly missions/circle-wind.yaml --controller slot --plant heading-hold --wind article "
        "--duration 300 --rate 20 --seed 1"
    )
    assert command in read(page).text


def test_a_wind_that_only_the_mission_knows_is_not_on_the_command_line(circle_flight):
    command = reproduction_command(summarise(replace(circle_flight, wind="steady", mode="live")))
    assert "--wind" not in command
    assert "--live" in command


FIGURES = {0.05557: "0.056 m", 1.234: "1.23 m", 28.165: "28.2 m", 12345.6: "12346 m"}


@pytest.mark.parametrize(("value", "text"), [*FIGURES.items(), (None, "not measured")])
def test_figures_have_about_three_digits(value, text):
    assert in_digits(value, "m") == text


def shown(record: FlightRecord) -> str:
    console = Console(width=100)
    with console.capture() as capture:
        console.print(summary_table(summarise(record)))
    return capture.get()


def test_the_terminal_shows_each_vehicle_and_the_verdict(circle_flight):
    text = shown(circle_flight)
    assert "circle-wind" in text
    for start in ("leader, from its path", "f1, from its slot", "f3, from its slot", "formation"):
        assert start in text
    assert "Accepted" in text


def test_the_terminal_shows_every_reason(circle_flight):
    text = shown(replace(circle_flight, acceptance=STRICT))
    assert "Not accepted" in text
    assert "is above 0.001 m" in text


def test_names_are_no_markup_on_the_terminal():
    time_s = np.arange(3.0)
    record = still_flight(time_s, still_vehicle("[red]x[/red]", "leader", time_s), mission="[/]")
    assert "[red]x[/red]" in shown(record)
