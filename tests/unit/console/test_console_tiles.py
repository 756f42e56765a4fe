"""Map tiles of a file that may come from anybody, and addresses of servers."""

import gc
import sqlite3
from contextlib import closing, suppress
from pathlib import Path
from threading import Thread

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from vfguide.errors import InputError
from vfguide.lab.console.tiles import LARGEST_TILE, TileFile, open_tiles

PNG = b"\x89PNG\r\n\x1a\n" + b"a picture"
JPEG = b"\xff\xd8\xff" + b"another"

TILES = (
    "CREATE TABLE tiles (zoom_level INTEGER, tile_column INTEGER, tile_row INTEGER, tile_data BLOB)"
)


def written(
    path: Path, *tiles: tuple[int, int, int, object], schema: str = TILES, **metadata: str
) -> Path:
    """An MBTiles file; rows count from the south."""
    with closing(sqlite3.connect(path)) as file:
        file.execute("CREATE TABLE metadata (name TEXT, value TEXT)")
        file.executemany("INSERT INTO metadata VALUES (?, ?)", metadata.items())
        file.executescript(schema)
        if tiles:
            file.executemany("INSERT INTO tiles VALUES (?, ?, ?, ?)", tiles)
        file.commit()
    return path


def test_a_tile_is_found_by_its_row_from_the_north(tmp_path):
    """At zoom 2 there are four rows: the third from the south is the second from the north."""
    path = written(tmp_path / "a.mbtiles", (2, 3, 2, PNG), (4, 0, 0, JPEG))
    tiles = TileFile(path)
    assert (tiles.source.least_zoom, tiles.source.greatest_zoom) == (2, 4)
    found = tiles.find(2, 3, 1)
    assert (found.kind, found.data) == ("image/png", PNG)
    assert tiles.find(4, 0, 15).kind == "image/jpeg"
    assert tiles.find(2, 3, 2) is None


def test_a_map_that_nobody_uses_any_more_is_closed_from_any_thread(tmp_path, monkeypatch):
    faults: list[object] = []
    monkeypatch.setattr("sys.unraisablehook", faults.append)
    opened = [TileFile(written(tmp_path / "map.mbtiles", (0, 0, 0, PNG)))]

    thread = Thread(target=lambda: (opened.clear(), gc.collect()))
    thread.start()
    thread.join()
    assert not faults


def test_what_the_file_says_of_itself_is_shown_as_text(tmp_path):
    said = {"minzoom": "3", "maxzoom": "17", "attribution": '<a href="x">Survey</a> of\nsomebody'}
    source = TileFile(written(tmp_path / "a.mbtiles", (5, 0, 0, PNG), **said)).source
    assert (source.least_zoom, source.greatest_zoom) == (3, 17)
    assert source.attribution == "Survey of somebody"
    assert source.origin == "'self'"


@pytest.mark.parametrize("place", [(-1, 0, 0), (2, 4, 0), (2, 0, 4), (2, -1, 0), (999, 0, 0)])
def test_places_that_no_map_has_are_not_looked_up(tmp_path, place):
    assert TileFile(written(tmp_path / "a.mbtiles", (2, 0, 0, PNG))).find(*place) is None


@pytest.mark.parametrize(
    ("tile", "reason"),
    [
        (b"\x1f\x8bvector", "holds pbf tiles, not pictures"),
        ("text", "holds pbf tiles, not pictures"),
        (None, "holds pbf tiles, not pictures"),
        (PNG + bytes(LARGEST_TILE), "string or blob too big"),
    ],
)
def test_tiles_that_are_no_pictures_are_one_line(tmp_path, tile, reason):
    path = written(tmp_path / "a.mbtiles", (2, 0, 0, tile), format="pbf")
    with pytest.raises(InputError, match=reason) as caught:
        open_tiles(str(path))
    assert "give an MBTiles file of PNG or JPEG tiles" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_files_that_are_something_else_are_one_line(tmp_path):
    text = tmp_path / "text.mbtiles"
    text.write_text("no tiles")
    damaged = written(tmp_path / "damaged.mbtiles", (2, 0, 0, PNG))
    damaged.write_bytes(damaged.read_bytes()[:100] + b"\xff" * 3000)
    other = written(tmp_path / "other.mbtiles", schema="CREATE TABLE places (name TEXT)")
    empty = written(tmp_path / "empty.mbtiles")
    deep = written(tmp_path / "deep.mbtiles", (99, 0, 0, PNG))
    elsewhere = (tmp_path, tmp_path / "absent", Path("/dev/zero"))
    for path in (text, damaged, other, empty, deep, *elsewhere):
        with pytest.raises(InputError, match=r"^--tiles ") as caught:
            open_tiles(str(path))
        assert "\n" not in str(caught.value)


def test_a_file_that_has_a_search_without_an_end_instead_of_tiles_ends_in_one_line(tmp_path):
    columns = "0 AS tile_column, 0 AS tile_row, NULL AS tile_data"
    endless = (
        "CREATE VIEW tiles AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n)"  # noqa: S608
        f" SELECT i AS zoom_level, {columns} FROM n WHERE i < 0"
    )
    calling = f"CREATE VIEW tiles AS SELECT length(randomblob(9)) AS zoom_level, {columns}"
    for number, schema in enumerate((endless, calling)):
        path = written(tmp_path / f"{number}.mbtiles", schema=schema)
        with pytest.raises(InputError, match=r"not authorized|prohibited"):
            open_tiles(str(path))
    joins = ", ".join(f"metadata m{number}" for number in range(40))
    crossed = (
        f"CREATE VIEW tiles AS SELECT 0 AS zoom_level, {columns} FROM {joins}"  # noqa: S608
        " WHERE m39.name || m38.name = 'none'"
    )
    path = written(tmp_path / "crossed.mbtiles", schema=crossed, a="1", b="2", c="3", d="4")
    with pytest.raises(InputError, match="interrupted"):
        open_tiles(str(path))


def test_an_attribution_of_nothing_but_brackets_takes_no_time(tmp_path):
    """A search for tags in a million of them would take hours."""
    path = written(tmp_path / "a.mbtiles", (4, 0, 0, JPEG), attribution="<" * 1_000_000)
    assert len(open_tiles(str(path)).attribution) <= 200


@settings(max_examples=60, deadline=None)
@given(data=st.binary(max_size=300), zoom=st.one_of(st.integers(), st.text(), st.binary()))
def test_whatever_a_file_holds_it_is_a_map_or_one_line(tmp_path_factory, data, zoom):
    path = tmp_path_factory.mktemp("tiles") / "a.mbtiles"
    try:
        written(path, (zoom, 0, 0, data))  # type: ignore[arg-type]
    except OverflowError:
        return
    try:
        found = TileFile(path).source
    except InputError as error:
        assert "\n" not in str(error)  # noqa: PT017 - it may be a map as well
    else:
        assert found.greatest_zoom == zoom


@settings(max_examples=60, deadline=None)
@given(damage=st.lists(st.tuples(st.integers(0, 4095), st.integers(0, 255)), max_size=6))
# SQLite complains of a damaged schema in its own bytes, which are no text.
@example(damage=[(place, 0x94) for place in range(3900, 4096)])
def test_a_damaged_map_is_a_map_or_one_line(tmp_path_factory, damage):
    path = written(tmp_path_factory.mktemp("tiles") / "a.mbtiles", (4, 0, 0, JPEG), format="png")
    content = bytearray(path.read_bytes())
    for place, byte in damage:
        content[place] = byte
    path.write_bytes(content)
    with suppress(InputError):
        open_tiles(str(path))


def test_a_damaged_schema_is_told_in_one_line(tmp_path):
    path = written(tmp_path / "a.mbtiles", (4, 0, 0, JPEG))
    path.write_bytes(path.read_bytes().replace(b"CREATE TABLE tiles", b"CREATE \x94\xc9BLE tiles"))
    with pytest.raises(InputError, match=r"cannot be read as map tiles \(its tables are damaged\)"):
        open_tiles(str(path))


def test_tiles_of_a_server_are_allowed_from_that_server_alone():
    source = open_tiles("https://tile.example.org:8443/{z}/{x}/{y}.png?key=a")
    assert source.origin == "https://tile.example.org:8443"
    assert source.find is None


@pytest.mark.parametrize(
    "address",
    [
        "http://tile.example.org/{z}/{x}/{y}.png",
        "https://tile.example.org/{z}/{x}.png",
        "https://{s}.tile.example.org/{z}/{x}/{y}.png",
        "https://a.example.org;script-src *//{z}/{x}/{y}",
        "https://a.example.org/{z}/{x}/{y} ; script-src *",
        "https://user@a.example.org/{z}/{x}/{y}",
        "ftp://a.example.org/{z}/{x}/{y}",
    ],
)
def test_an_address_that_is_none_is_one_line(address):
    with pytest.raises(InputError, match="is no https address"):
        open_tiles(address)
