"""`vfguide fly`: its exit status, and one line for each fault."""

import pytest

from vfguide.errors import VfguideError


def test_a_flight_within_its_acceptance_ends_with_0(flown):
    assert flown.outcome.status == 0


def test_a_flight_outside_its_acceptance_ends_with_1_and_says_why(command, pair_with):
    mission = pair_with(("mean_error_m: 1,", "mean_error_m: 0.0001,"))
    outcome = command("fly", mission, "--duration", 12)
    assert outcome.status == 1
    assert "Not accepted" in outcome.out
    assert "is above 0.0001 m" in outcome.out


@pytest.mark.usefixtures("one_plot")
def test_followers_that_do_not_come_to_their_slots_are_no_success_of_a_mission_that_asks_for_nothing(
    command, pair_with, tmp_path
):
    """The aircraft answers a tenth as fast as it is declared, and starts far away."""
    mission = pair_with()
    out = tmp_path / "out"
    outcome = command(
        *("fly", mission, "--duration", 12, "--out", out),
        *("--set", "acceptance={}", "--set", "rehearsal.emulator.vehicles.wing.alpha_1_s=0.02"),
        *("--set", "rehearsal.start.wing={forward_m: -60, right_m: -60, course_deg: 180}"),
    )
    assert outcome.status == 1
    assert "Not accepted" in outcome.out
    assert "m from its slot in the last half" in outcome.out
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "m from its slot in the last half" in page
    assert "Not accepted" in page


def test_a_leader_alone_is_flown_and_not_judged(command, alone_with):
    outcome = command("fly", alone_with(), "--duration", 10)
    assert outcome.status == 0
    assert "one, from its path" in outcome.out
    assert "Not judged" in outcome.out


def test_the_shortest_flight_is_one_second(command, pair_with):
    outcome = command("fly", pair_with(), "--duration", 1)
    assert outcome.status == 1
    assert "still out at the end" not in outcome.out.split("within 1 m")[0]


@pytest.mark.parametrize(
    ("option", "value", "complaint"),
    [
        ("--duration", "-1", "-1 is too small; choose 1 or more"),
        ("--duration", "0", "0 is too small; choose 1 or more"),
        ("--duration", "nan", "nan is not a finite number; write a finite number"),
        ("--duration", "1e999", "inf is not a finite number; write a finite number"),
        ("--rate", "0", "0 is too small; choose 2 or more"),
        ("--rate", "-20", "-20 is too small; choose 2 or more"),
        ("--rate", "201", "201 is too large; choose 100 or less"),
        ("--rate", "nan", "nan is not a finite number; write a finite number"),
        ("--seed", "-1", "-1 is too small; choose 0 or more"),
        ("--seed", "4294967296", "4294967296 is too large; choose 4294967295 or less"),
    ],
)
def test_a_value_out_of_range_is_one_line_that_names_the_option(
    refusal, alone_with, option, value, complaint
):
    assert refusal("fly", alone_with(), option, value) == f"{option}: {complaint}"


def test_every_option_out_of_range_has_its_line(command, alone_with):
    outcome = command("fly", alone_with(), "--duration", -1, "--rate", 0, "--seed", -1)
    assert outcome.status == 2
    assert [line.split(":")[0] for line in outcome.lines] == ["--duration", "--rate", "--seed"]


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("--controller", "bang-bang"), "--controller"),
        (("--plant", "rocket"), "--plant"),
        (("--wind", "storm"), "--wind"),
        (("--duration", "long"), "--duration"),
        (("--duration",), "--duration"),
        (("--seed", "1.5"), "--seed"),
        (("--rate", ""), "--rate"),
        (("--bogus",), "--bogus"),
        (("another.yaml",), "another.yaml"),
    ],
)
def test_options_that_make_no_sense_end_with_2_and_are_named(command, alone_with, arguments, named):
    outcome = command("fly", alone_with(), *arguments)
    assert outcome.status == 2
    assert outcome.out == ""
    assert named in outcome.lines[-1]


def test_a_missing_file_is_one_line(refusal, tmp_path):
    path = tmp_path / "none.yaml"
    line = refusal("fly", path)
    assert line.startswith(
        f"{path}: there is no such file; give the path of a mission file, or one of"
    )
    assert "circle-wind" in line


def test_a_mission_that_cannot_be_flown_is_refused_before_flying(refusal, alone_with, tmp_path):
    path = alone_with(("radius_m: 150", "radius_m: 20"))
    line = refusal("fly", path, "--out", tmp_path / "out")
    assert line.startswith(f"{path}:3: error: path: 'one' has to bank")
    assert not (tmp_path / "out").exists()


def test_warnings_are_told_and_flown(command, pair_with):
    outcome = command("fly", pair_with(), "--duration", 2)
    warnings = [line for line in outcome.lines if " warning: " in line]
    assert len(warnings) == 1
    assert "acceptance.settle_10m_s: 15 s is no shorter than the rehearsal of 2 s" in warnings[0]


def test_progress_is_plain_lines_where_there_is_no_terminal(command, alone_with):
    outcome = command("fly", alone_with(), "--duration", 10)
    assert outcome.lines == [f"flying alone: {now} of 10 s" for now in (2, 4, 6, 8, 10)]


def test_a_flight_that_breaks_ends_with_3(command, alone_with, monkeypatch):
    def break_down(*_arguments: object, **_named: object) -> None:
        raise VfguideError("a flight process died (exit code -9)")

    monkeypatch.setattr("vfguide.commands.fly.fly_rehearsal", break_down)
    outcome = command("fly", alone_with())
    assert outcome.status == 3
    assert outcome.lines == ["a flight process died (exit code -9)"]


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("shapes", "--speedup", "4"), "orders: are timed in real time; leave --speedup out"),
        (
            ("leader-lost", "--set", "rehearsal.losses=[{vehicle: f1, at_s: 90, what: link}]"),
            "rehearsal.losses: only a flight in virtual time loses a link",
        ),
    ],
)
def test_what_cannot_be_kept_to_live_is_refused(refusal, words, text):
    assert refusal("fly", *words, "--live").startswith(text)
