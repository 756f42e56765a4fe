"""Figures of the docs: rows are read, those that belong together are shown, pages agree with their files."""

from importlib import import_module

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.benchmarks.results import (
    OLD,
    ROOT,
    Row,
    Study,
    age_of,
    append,
    figure_of,
    main,
    pages,
    rows_of,
    studies,
    table,
    table_named,
    together,
    written,
)

COLUMNS = {
    "flown": "{case}",
    "mean": "{mean_m:.2f} m",
    "worst": "{mean_m.worst:.1f}",
    "end": "{end}",
}
STUDY = Study(columns=COLUMNS, command="make results", code=["vfguide"])


def row_of(case="line", commit="aaaa", date="2026-11-28T10:00:00Z", **figures):
    flown = {"case": case, "commit": commit, "date": date, "figures": figures}
    return Row(**flown, command="make results", machine="2 processors", load=1.5)


def test_a_row_flown_by_hand_has_numbers_lists_and_words():
    found = dict(map(figure_of, ["mean_m=0.25", "max_m=1.5,2", "back=never left"]))
    assert found == {"mean_m": 0.25, "max_m": [1.5, 2.0], "back": "never left"}


FINITE = st.floats(allow_nan=False, allow_infinity=False)
TEXTS = dict.fromkeys(("case", "command", "commit", "date", "machine"), st.text())
FIGURES = st.dictionaries(st.text(), st.none() | FINITE | st.text() | st.lists(FINITE))
ROWS = st.builds(Row, **TEXTS, load=st.none() | FINITE, figures=FIGURES)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["append"], "give a study, a case and figures"),
        (["append", "nobody", "line", "mean_m=1"], "there is no study 'nobody'; known are "),
        (["append", "suite", "slot", "mean_m"], "write NAME=VALUE"),
        (["append", "suite", "slot", "=1"], "write NAME=VALUE"),
        (["measure", "nobody"], "there is no study 'nobody'; known are "),
    ],
)
def test_rubbish_is_refused_in_one_line(monkeypatch, capsys, words, said):
    monkeypatch.setattr("sys.argv", ["results", *words])
    with pytest.raises(SystemExit, match="2"):
        main()
    assert said in capsys.readouterr().err


def test_a_table_by_hand():
    rows = [
        row_of(mean_m=9.0, end="lost"),
        row_of(commit="bbbb", mean_m=0.25, end="tracking"),
        row_of(commit="bbbb", mean_m=0.5, end="tracking"),
        row_of("circle", commit="aaaa", date="2026-11-27", mean_m=[0.121, 0.124], end=""),
    ]
    assert table(STUDY, rows, is_old=lambda commit: commit == "aaaa").splitlines() == [
        "| flown | mean | worst | end | measured |",
        "|---|---|---|---|---|",
        "| line | 0.25 to 0.50 m | 0.5 | tracking | 2026-11-28 |",
        "| circle | 0.12 m | 0.1 |  | 2026-11-27 † |",
        "",
        "`make results`",
    ]


def test_a_figure_that_nobody_measured_is_a_dash_and_one_date_stands_below():
    lines = table(STUDY, [row_of(mean_m=None)], is_old=lambda _: True).splitlines()
    assert lines[2:] == ["| line | - m | - | - |", "", "`make results`, 2026-11-28 †"]


def test_rows_of_another_commit_or_command_do_not_belong_to_the_newest():
    old, new = row_of(commit="aaaa"), row_of(commit="bbbb")
    other = msgspec.structs.replace(new, command="by hand")
    assert together([new, old, new, new]) == {"line": [new, new]}
    assert together([new, other]) == {"line": [other]}


@given(rows=st.lists(ROWS, max_size=4))
def test_rows_come_back_as_they_were_appended(tmp_path_factory, rows):
    folder = tmp_path_factory.mktemp("results")
    append("study", rows, folder)
    assert rows_of("study", folder) == rows


@given(line=st.binary().filter(lambda one: one.strip() and not one.splitlines()[1:]))
def test_a_line_that_is_no_row_is_refused_with_its_place(tmp_path_factory, line):
    folder = tmp_path_factory.mktemp("results")
    append("study", [row_of()], folder)
    with (folder / "study.jsonl").open("ab") as file:
        file.write(line)
    with pytest.raises(ValueError, match=r"study\.jsonl, line 2"):
        rows_of("study", folder)


def test_only_what_stands_between_the_marks_is_written():
    one, two = (
        "before\n<!-- table one -->\nold\n<!-- end -->\n",
        "<!-- table two -->\n<!-- end -->\n",
    )
    page = f"{one}between\n{two}"
    anew = written(page, lambda name: f"| {name} |")
    assert anew == page.replace("old\n", "\n| one |\n").replace("two -->\n", "two -->\n\n| two |\n")
    assert written(anew, lambda name: f"| {name} |") == anew


def test_code_without_changes_since_is_not_old_and_an_unknown_commit_is():
    if not (ROOT / ".git").exists():
        pytest.skip("a checkout without history tells no age")
    assert not age_of(["vfguide"])("HEAD")
    assert age_of(["vfguide"])("0000beef")


def test_without_history_nothing_is_marked(monkeypatch):
    monkeypatch.setattr("tests.benchmarks.results.git", lambda *_: None)
    assert not age_of(["vfguide"])("0000beef")


@pytest.mark.parametrize("page", list(pages()), ids=lambda page: page.name)
def test_tables_say_what_their_files_say(page):
    text = page.read_text(encoding="utf-8")
    assert written(text, table_named).replace(OLD, "") == text.replace(OLD, ""), "run `make tables`"


@pytest.mark.parametrize("name", list(studies()))
def test_a_study_can_be_measured_and_has_rows_that_fill_its_table_on_a_page(name):
    study = studies()[name]
    module, _, function = study.measure.partition(":")
    assert not module or callable(getattr(import_module(module), function))
    known = together(rows_of(study.rows or name))
    assert known.keys() >= set(study.cases)
    assert known
    assert all((ROOT / path).exists() for path in study.code)
    assert any(f"<!-- table {name} -->" in page.read_text(encoding="utf-8") for page in pages())
