"""Odd terminals, odd languages and odd arguments: real processes that must not end with a traceback."""

import json
import os
import pty
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import pytest

ASCII = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "PYTHONIOENCODING": "ascii"}


@pytest.mark.parametrize("verb", ["fly", "check", "report"])
def test_help_tells_the_exit_statuses(command, verb):
    for option in ("--help", "-h"):
        outcome = command(verb, option)
        assert outcome.status == 0
        assert f"vfguide {verb}" in outcome.out
        assert "Exit status: 0 " in outcome.out


def test_help_names_every_command_in_a_line_of_its_own(command):
    outcome = command("--help")
    assert outcome.status == 0
    for verb in ("fly", "check", "report"):
        (line,) = [one for one in outcome.out.splitlines() if one.startswith(f"  {verb} ")]
        assert line.endswith(".")
        assert not line.endswith("...")


def test_without_arguments_the_help_is_shown(command):
    outcome = command()
    assert outcome.status == 2
    assert "Usage: vfguide" in outcome.out + outcome.err


@pytest.mark.parametrize(
    "arguments",
    [
        *(("flie",), ("fly",), ("check",), ("report",), ("",), ("--",), ("--bogus",)),
        *(("fly", "--out"), ("fly", "\x1b[2J", "\n"), ("check", "a", "b")),
        *(("check", "--strict=maybe", "a"), ("report", "--out"), ("\U0001f6e9",)),
    ],
)
def test_arguments_that_make_no_sense_end_with_2_and_one_line(refusal, arguments):
    line = refusal(*arguments)
    assert line.startswith("vfguide")
    assert line.endswith(" -h")


def test_a_terminal_without_the_letters_of_a_message_shows_escapes(process, alone_with, tmp_path):
    steep = alone_with(("radius_m: 150", "radius_m: 30"), name="f\u00fcnf.yaml")
    checked = process("check", steep, environment=ASCII)
    assert checked.status == 2
    assert "has to bank 54\\xb0 on the turn" in checked.out
    as_json = process("check", steep, "--json", environment=ASCII)
    assert "54\u00b0" in json.loads(as_json.out)["findings"][0]["message"]
    directory = tmp_path / "fl\u00fcge"
    flown = process("fly", alone_with(), "--duration", 1, "--out", directory, environment=ASCII)
    assert flown.status == 0
    assert (directory / "report.html").is_file()
    assert process("flie\u00dfen", environment=ASCII).status == 2


@pytest.mark.usefixtures("unflown")
@pytest.mark.parametrize("columns", ["0", "1", "20", "-5", "wide"])
def test_a_terminal_of_any_width_will_do(command, pair_with, monkeypatch, columns):
    monkeypatch.setenv("COLUMNS", columns)
    monkeypatch.setenv("NO_COLOR", "1")
    outcome = command("fly", pair_with(), "--duration", 2)
    assert outcome.status == 1
    assert "flying pair: 2 of 2 s" in outcome.lines
    assert command("check", pair_with()).status == 0


@pytest.mark.parametrize("columns", [80, 120])
def test_the_table_fits_a_usual_terminal(command, pair_with, monkeypatch, columns):
    monkeypatch.setenv("COLUMNS", str(columns))
    lines = command("fly", pair_with(), "--duration", 12).out.splitlines()
    assert max(len(line) for line in lines) <= columns
    settings = "controller slot, plant heading-hold, wind calm, lockstep, 20 Hz, seed 1"
    assert settings in lines
    (settled,) = [line for line in lines if line.startswith("within 10 m: after ")]
    assert settled.endswith(" m")


@pytest.mark.parametrize(
    "arguments", [("check",), ("check", "--json"), ("fly", "--duration", "2")], ids=" ".join
)
@pytest.mark.parametrize("both", [False, True], ids=["output", "output and errors"])
def test_a_reader_that_leaves_early_does_no_harm(process, alone_with, arguments, both):
    """As `vfguide check m.yaml | head -0` does, with `2>&1` or without."""
    reading, writing = os.pipe()
    os.close(reading)
    try:
        errors = {"stderr": writing} if both else {}
        outcome = process(*arguments, alone_with(), stdout=writing, **errors)
    finally:
        os.close(writing)
    assert outcome.status == 0
    assert "BrokenPipe" not in outcome.err


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_a_full_disk_is_one_line(process, alone_with):
    with Path("/dev/full").open("wb") as full:
        outcome = process("check", alone_with(), stdout=full.fileno())
    assert outcome.status == 3
    assert outcome.lines == ["No space left on device"]


def test_a_terminal_sees_a_bar_that_leaves_no_trace(process, alone_with):
    terminal, far_end = pty.openpty()
    environment = {"TERM": "xterm", "COLUMNS": "80"}
    with ThreadPoolExecutor() as reader:
        shown = reader.submit(everything_on, terminal)
        outcome = process(
            "fly", alone_with(), "--duration", 60, stderr=far_end, environment=environment
        )
        os.close(far_end)
        text = shown.result()
    assert outcome.status == 0
    assert "\x1b" not in outcome.out
    assert "flying alone" in text
    assert "of 60 s" in text
    assert text.rstrip().endswith("\x1b[2K")


def everything_on(terminal: int) -> str:
    """All that is written to a terminal until its last writer is gone."""
    content = b""
    # so Linux says that there is no writer left
    with suppress(OSError):
        while data := os.read(terminal, 4096):
            content += data
    os.close(terminal)
    return content.decode()


@pytest.mark.parametrize(
    "arguments",
    [
        ("fly", "MISSION", "--out", ""),
        ("report", ""),
        ("report", ".", "--out", ""),
        ("companion", "one", "--mission=MISSION", "--mavlink=x", "--link=y", "--record", ""),
    ],
)
def test_an_empty_name_is_no_directory(refusal, alone_with, tmp_path, monkeypatch, arguments):
    mission = alone_with()
    monkeypatch.chdir(tmp_path)
    line = refusal(*(one.replace("MISSION", str(mission)) for one in arguments))
    assert line == "DIR: is empty; name a directory, or . for the one you are in"
    assert list(tmp_path.iterdir()) == [mission]


def test_a_missing_signing_key_is_one_line_with_its_remedy(refusal, alone_with, tmp_path):
    key = tmp_path / "key"
    link = ("--mavlink=udpin://127.0.0.1:14999", "--link=mqtt://127.0.0.1:1", "--insecure")
    words = ("companion", "one", "--mission", alone_with(), *link, "--signing-key-file", key)
    told = f"{key}: cannot be read (No such file or directory); give a file with a key"
    assert refusal(*words).startswith(told)
