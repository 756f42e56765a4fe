"""Options of `sitl-stub` in a file."""

import re
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from sitl_stub import cli
from sitl_stub.fleet import Aircraft
from sitl_stub.option_file import MOST_BYTES, OptionFileError, read_options

KNOWN = {"system_id", "alpha", "airspeed_range", "gust"}


def test_lines_are_options_without_their_dashes(tmp_path: Path) -> None:
    file = tmp_path / "fleet.yaml"
    file.write_text('system-id: 3\nairspeed-range: "16,32"\ngust: ["10,5,1", "20,5,1"]\n')
    assert read_options(file, KNOWN) == {
        "system_id": 3,
        "airspeed_range": "16,32",
        "gust": ["10,5,1", "20,5,1"],
    }


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"alfa: 1", "there is no option 'alfa'; did you mean alpha?"),
        (b"- 1", "holds no options; write lines such as alpha: 0.9"),
        (b"", "holds no options"),
        (b"alpha: {a: 1}", "alpha: write one value, or a list of them"),
        (b"alpha: [", "this is no YAML"),
        (b"\xff\xfe\x00", "this is no YAML"),
        (b"#" * (MOST_BYTES + 1), "larger than 64 KiB"),
    ],
)
def test_a_wrong_file_is_one_line_with_a_remedy(content: bytes, said: str, tmp_path: Path) -> None:
    file = tmp_path / "fleet.yaml"
    file.write_bytes(content)
    with pytest.raises(OptionFileError, match=re.escape(said)):
        read_options(file, KNOWN)


@given(st.binary(max_size=200))
def test_whatever_it_holds_is_options_or_refused(content: bytes) -> None:
    with TemporaryDirectory() as place:
        file = Path(place, "fleet.yaml")
        file.write_bytes(content)
        try:
            options = read_options(file, KNOWN)
        except OptionFileError:
            return
    assert set(options) <= KNOWN


def test_the_command_line_goes_before_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "fleet.yaml"
    file.write_text("system-id: 3\nmavlink: udpout://127.0.0.1:1\nalpha: 0.9\nseed: 7\n")
    seen: dict[str, object] = {}

    def fleet_of(**options: object) -> list[object]:
        seen.update(options)
        raise ValueError("as far as this goes")

    monkeypatch.setattr(cli, "fleet_of", fleet_of)
    ended = CliRunner().invoke(cli.app, ["--config", str(file), "--seed", "8"])
    assert ended.exit_code == cli.WRONG_INPUT
    assert (seen["system_id"], seen["seed"]) == (3, 8)
    aircraft = seen["aircraft"]
    assert isinstance(aircraft, Aircraft)
    assert aircraft.alpha_1_s == 0.9


def test_it_tells_its_version() -> None:
    assert CliRunner().invoke(cli.app, ["--version"]).output.startswith("sitl-stub ")
