import math
from pathlib import Path

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from vfguide.record.guidance_log import HEADER, GuidanceStep, encode_step, read_guidance


def step(time_s: float, mode: str = "tracking") -> GuidanceStep:
    return GuidanceStep(
        time_s=time_s,
        mode=mode,
        course_rad=0.5,
        speed_m_s=21.0,
        limited=True,
        lyapunov_m2=0.25,
        formation_time_s=7.5,
    )


def written(path: Path, *steps: GuidanceStep) -> Path:
    path.write_bytes(HEADER + b"".join(encode_step(one) for one in steps))
    return path


def test_the_newest_step_that_is_not_later_counts(tmp_path: Path) -> None:
    track = read_guidance(written(tmp_path / "f1.csv", step(100.0, "joining"), step(100.05)))
    assert track.at(99.99) is None
    assert track.at(100.0) == step(100.0, "joining")
    assert track.at(100.049) == step(100.0, "joining")
    assert track.at(500.0) == step(100.05)


def test_times_count_from_where_the_flight_began(tmp_path: Path) -> None:
    track = read_guidance(written(tmp_path / "f1.csv", step(100.0)), zero_s=90.0)
    assert track.at(10.0) == step(10.0)


def test_what_was_not_sent_stays_unknown(tmp_path: Path) -> None:
    unsent = GuidanceStep(
        time_s=1.0,
        mode="waiting",
        course_rad=math.nan,
        speed_m_s=math.nan,
        limited=False,
        lyapunov_m2=math.nan,
    )
    found = read_guidance(written(tmp_path / "f1.csv", unsent)).at(1.0)
    assert found is not None
    assert math.isnan(found.course_rad)
    assert found.limited is False


def test_a_companion_that_was_killed_leaves_nothing(tmp_path: Path) -> None:
    assert read_guidance(tmp_path / "absent.csv").at(1.0) is None


def test_of_a_file_that_is_cut_off_anywhere_the_whole_lines_are_read(tmp_path: Path) -> None:
    path = written(tmp_path / "f1.csv", step(1.0), step(2.0))
    content = path.read_bytes()
    second = len(encode_step(step(2.0)))
    for left_out in range(1, second + 1):
        path.write_bytes(content[:-left_out])
        assert read_guidance(path).at(9.0) == step(1.0)


def test_the_starts_of_one_companion_make_one_track(tmp_path: Path) -> None:
    first, second = written(tmp_path / "1.csv", step(1.0)), written(tmp_path / "2.csv", step(5.0))
    track = read_guidance(second, first)
    assert track.at(4.9) == step(1.0)
    assert track.at(5.0) == step(5.0)


def test_a_file_without_an_end_is_not_read_for_ever() -> None:
    assert read_guidance(Path("/dev/zero")).at(1.0) is None


@given(content=st.binary(max_size=300))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
def test_any_bytes_are_read_or_left_alone(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "any.csv"
    path.write_bytes(b"time_s,mode,course_rad,speed_m_s,limited,lyapunov_m2\n" + content)
    read_guidance(path).at(0.0)
