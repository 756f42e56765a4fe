from vfguide.record.latency import (
    Latency,
    Percentiles,
    Promptness,
    Usage,
    compose_latency,
    describe_latency,
    latency_of,
)

FIGURES = {
    "leader": {"response_ms_p50": 0.2, "response_ms_p99": 3.0, "response_ms_max": 4.0},
    "f1": {
        "response_ms_p50": 0.3,
        "response_ms_p99": 2.0,
        "response_ms_max": 9.0,
        "leader_age_ms_p50": 50.0,
        "leader_age_ms_p99": 60.0,
        "leader_age_ms_max": 70.0,
    },
    "f2": {"response_ms_max": 0.0, "leader_age_ms_max": 0.0},
}


def latency() -> Latency:
    return latency_of(
        FIGURES, leader="leader", processes={"judge": Usage(cpu_share=0.1, rss_mb=80.0)}
    )


def test_what_companions_say_becomes_percentiles():
    vehicles = latency().vehicles
    assert vehicles["f1"].response_ms == Percentiles(p50=0.3, p99=2.0, max=9.0)
    assert vehicles["f1"].leader_age_ms == Percentiles(p50=50.0, p99=60.0, max=70.0)


def test_a_leader_has_no_age_and_a_companion_that_never_steered_has_nothing():
    said = {**FIGURES["f1"]}
    assert latency_of({"leader": said}, leader="leader").vehicles["leader"].leader_age_ms is None
    assert latency().vehicles["f2"] == Promptness(response_ms=None, leader_age_ms=None)


def test_together_no_companion_is_worse():
    together = latency().together()
    assert together.response_ms == Percentiles(p50=0.3, p99=3.0, max=9.0)
    assert together.leader_age_ms == Percentiles(p50=50.0, p99=60.0, max=70.0)


def test_a_latency_comes_back_from_its_description():
    described = describe_latency(latency())
    assert list(described) == ["response_ms", "leader_age_ms", "vehicles", "processes"]
    assert compose_latency(described) == latency()
