"""The baselines as ordinary laws: they fly the article's missions, on both plants, and over a bad link."""

import pytest

from vfguide.lab.studies.comparison import BAD_LINK
from vfguide.lab.studies.flown import Case, fly

SLOW = {"rehearsal": {"duration_s": 50.0, "rate_hz": 10.0}}


@pytest.mark.parametrize("law", ["pid", "mpc"])
def test_a_baseline_holds_its_slots(law):
    case = Case(mission="line-wind", controller=law, changes=SLOW)
    figures = fly(case)
    assert figures.mean_error_m < 0.25
    assert figures.settle_1m_s is not None
    assert figures.settle_1m_s < 40.0
    assert figures.min_separation_m > 5.0


@pytest.mark.parametrize("law", ["pid", "mpc"])
def test_a_baseline_flies_the_articles_plant_over_a_bad_link(law):
    case = Case(
        mission="circle-wind",
        controller=law,
        plant="course-hold",
        changes={"rehearsal": {**BAD_LINK, **SLOW["rehearsal"]}},
    )
    assert fly(case).mean_error_m < 1.0
