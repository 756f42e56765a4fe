"""The arithmetic of studies, and that a study is the same wherever it is flown."""

import math

import pytest

from tests.kit.figures import figures_with
from tests.kit.missions import shipped
from vfguide.lab.studies.comparison import seeded, summed_up
from vfguide.lab.studies.flown import MISSIONS, Case, article_mission, dask_executor, flown_by, fly
from vfguide.lab.studies.scale import crowd, growth_exponent


@pytest.mark.parametrize("name", MISSIONS)
def test_the_benchmark_flies_the_shipped_missions(name):
    # What a good flight is, is not flown.
    dumped = [
        one.model_dump(exclude={"acceptance"}) for one in (article_mission(name), shipped(name))
    ]
    assert dumped[0] == dumped[1]


def test_a_mean_comes_with_its_confidence_interval():
    found = summed_up([figures_with(mean_error_m=mean_m) for mean_m in (1.0, 2.0, 3.0)])
    assert found["mean_m"] == pytest.approx(2.0)
    # Standard deviation 1, three values, 97.5 % point 4.30265.
    assert found["mean_m_half"] == pytest.approx(4.30265 / math.sqrt(3.0))
    assert found["p95_m_half"] == pytest.approx(0.0)


def test_one_flight_has_no_interval_and_one_that_never_settled_no_mean():
    found = summed_up([figures_with()])
    assert found["mean_m"] == 1.0
    assert math.isnan(found["mean_m_half"])
    unsettled = summed_up([figures_with(), figures_with(settle_1m_s=None)])
    assert unsettled["settle_1m_s"] is None


def test_seeds_differ_and_repeat():
    assert seeded("line-calm", 1, 60.0) == seeded("line-calm", 1, 60.0)
    assert seeded("line-calm", 1, 60.0) != seeded("line-calm", 2, 60.0)


def test_the_exponent_of_a_cost_that_grows_with_the_square_is_two():
    sizes = [
        {"vehicles": count, "processor_s": 0.3 * count**2 * 5.0, "duration_s": 5.0}
        for count in (4, 10, 30, 100)
    ]
    assert growth_exponent(sizes) == pytest.approx(2.0)


def test_a_crowd_keeps_its_distances():
    mission = crowd(100, 5.0)
    slots = [(0.0, 0.0), *((one.slot.forward_m, one.slot.right_m) for one in mission.followers)]
    assert len(set(slots)) == 100


def test_a_dask_cluster_takes_the_same_call():
    from distributed import LocalCluster

    short = {"rehearsal": {"duration_s": 3.0}}
    tasks = [Case(mission="circle-wind", controller=law, changes=short) for law in ("slot", "pid")]
    here = [fly(one).mean_error_m for one in tasks]
    with (
        LocalCluster(
            n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None
        ) as cluster,
        dask_executor(cluster.scheduler_address) as executor,
    ):
        there = [one.mean_error_m for one in flown_by(executor, fly, tasks)]
    assert there == here
