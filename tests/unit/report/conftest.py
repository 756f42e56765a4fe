"""Flights made up from formulas, and the page of one."""

import pytest

from tests.kit.records import made_up_flight
from vfguide.lab.report.page import write_report


@pytest.fixture(scope="session")
def circle_flight():
    return made_up_flight("circle")


@pytest.fixture(scope="session")
def circle_report(circle_flight, tmp_path_factory):
    """The page of the circle flight; its plots are beside it."""
    return write_report(circle_flight, tmp_path_factory.mktemp("circle") / "new")


@pytest.fixture(scope="session")
def line_flight():
    return made_up_flight("line")
