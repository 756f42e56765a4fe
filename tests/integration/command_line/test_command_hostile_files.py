"""Whatever is given for a mission file ends with status 2 and a line, never with a traceback."""

import os
from pathlib import Path

import pytest

BOMB = "a: &a [x, x, x, x]\n" + "".join(
    f"{name}: &{name} [{', '.join([f'*{before}'] * 9)}]\n"
    for before, name in zip("abcdefgh", "bcdefghi", strict=True)
)

HOSTILE = {
    "empty": b"",
    "zeros": bytes(4096),
    "binary": bytes(range(256)) * 16,
    "executable": b"\x7fELF\x02\x01\x01" + bytes(200),
    "utf-16": "name: alone\n".encode("utf-16"),
    "latin-1": "name: f\u00fcnf\n".encode("latin-1"),
    "surrogate": b'name: "\\ud83d"\n',
    "deep list": b"[" * 200_000,
    "deep group": b"{a: " * 50_000,
    "deep indentation": b"".join(b" " * depth + b"a:\n" for depth in range(1500)),
    "billion laughs": BOMB.encode(),
    "endless line": b"name: " + b"a" * 900_000,
    "many fields": b"".join(b"field%d: 1\n" % number for number in range(15_000)),
    "more than a megabyte": b"# comment\n" * 110_000,
    "object tag": b"!!python/object/apply:os.system [touch /tmp/never]\n",
    "merge key": b"<<: {name: a}\nname: b\n",
    "control characters": b'name: "\\e]0;title\\a\\e[2J"\n',
    "control characters as they are": b"name: a\x1b[2J\x07b\n",
    "control characters in a field": b'"\\e[31mred\\n": 1\n',
    "huge number": b"height_above_origin_m: " + b"9" * 4000 + b"\n",
    "tiny number": b"height_above_origin_m: 1e-999\n",
    "right to left": "name: \u202eenola\n".encode(),
    "json": b'{"name": "alone", "origin": null}',
    "html": b"<!DOCTYPE html><html><body>not found</body></html>\n",
    "list": b"- name: alone\n",
    "two documents": b"name: a\n---\nname: b\n",
}


@pytest.mark.parametrize("kind", HOSTILE)
@pytest.mark.parametrize("verb", ["check", "fly"])
def test_no_content_of_a_file_is_more_than_a_wrong_input(command, tmp_path, verb, kind):
    path = tmp_path / "m.yaml"
    path.write_bytes(HOSTILE[kind])
    outcome = command(verb, path)
    assert outcome.status == 2
    assert outcome.out == ""
    assert 1 <= len(outcome.lines) <= 51
    for line in outcome.lines[:50]:
        assert line.startswith(str(path))
        assert len(line) < 600
        assert line.isprintable()


def test_of_a_thousand_faults_fifty_are_shown(command, tmp_path):
    path = tmp_path / "m.yaml"
    path.write_bytes(b"".join(b"field%d: 1\n" % number for number in range(1000)))
    outcome = command("check", path)
    assert len(outcome.lines) == 51
    assert outcome.lines[-1].startswith("and ")
    assert outcome.lines[-1].endswith(" more")


@pytest.mark.parametrize("verb", ["check", "fly"])
def test_what_is_no_file_is_one_line(refusal, tmp_path, verb):
    loop = tmp_path / "loop"
    loop.symlink_to(loop)
    for path, reason in [
        (tmp_path, "this is a directory"),
        (Path("/dev/null"), "this is a pipe or a device"),
        (tmp_path / "none" / "m.yaml", "there is no such file"),
        (loop, "cannot be read"),
        (tmp_path / ("long" * 200), "cannot be read"),
        (Path(), "this is a directory"),
        (tmp_path / "\u202e\x1b[2Jname\n", "there is no such file"),
    ]:
        line = refusal(verb, path)
        assert reason in line
        assert line.isprintable()


@pytest.mark.parametrize("name", ["f\u00fcnf \u2708.yaml", "-.yaml", "a b'c\"d.yaml", "%s{}.yaml"])
def test_a_file_may_be_called_whatever_it_likes(command, alone_with, name):
    assert command("check", "--", alone_with(name=name)).status == 0


@pytest.mark.parametrize("name", ["fl\\u00fcge", "a/../b", "[bold]x[/bold]", "", "-x", "a\\nb"])
def test_a_mission_has_a_plain_name(refusal, alone_with, name):
    path = alone_with(("name: alone", f'name: "{name}"'))
    line = refusal("check", path)
    assert line.startswith(f"{path}:1: name: ")
    assert "cannot be a name; use up to 64 lower-case letters, digits and hyphens" in line


@pytest.mark.parametrize("name", ["../../one", "a b", "\u00fc", "[red]", "x" * 33])
def test_a_vehicle_has_a_plain_name(command, alone_with, name):
    outcome = command("check", alone_with(("vehicle: one", f'vehicle: "{name}"')))
    assert outcome.status == 2
    assert any("leader.vehicle: " in line for line in outcome.lines)


@pytest.mark.parametrize("verb", ["check", "fly"])
def test_a_pipe_or_a_device_is_not_waited_for(refusal, tmp_path, verb):
    pipe = tmp_path / "pipe.yaml"
    os.mkfifo(pipe)
    for path in (pipe, Path("/dev/zero")):
        told = "this is a pipe or a device; give the path of a mission file"
        assert refusal(verb, path).endswith(told)


@pytest.mark.parametrize("option", [("--speedup", "5"), ("--link", "mqtt://127.0.0.1")])
def test_what_only_a_live_flight_can_do_is_not_passed_over(refusal, pair_with, option):
    line = refusal("fly", pair_with(), *option)
    assert line.startswith(option[0])
    assert "add --live, or leave it out" in line
