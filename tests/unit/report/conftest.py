"""A flight made up from formulas, and its page."""

import pytest

from tests.kit import records
from vfguide.lab.report.page import write_report


@pytest.fixture(scope="session")
def circle_flight():
    return records.circle_flight()


@pytest.fixture(scope="session")
def circle_report(circle_flight, tmp_path_factory):
    """The page of the circle flight; its plots are beside it."""
    return write_report(circle_flight, tmp_path_factory.mktemp("circle") / "new")
