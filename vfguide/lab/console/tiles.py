"""Map tiles for the console: a file of raster tiles (MBTiles), or the address of a server.

MBTiles 1.3 is an SQLite file with a table or view `tiles` and a table `metadata` (name, value). Columns of
`tiles` are zoom_level, tile_column, tile_row and tile_data; rows count from the south. The file may come from
anybody. So it is opened read-only, its schema is not trusted, and a query that takes too long or finds too
much yields nothing.
"""

import re
import sqlite3
import weakref
from collections.abc import Callable
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path
from time import monotonic
from urllib.parse import quote, urlsplit

import pymap3d.rcurve

from vfguide.errors import InputError
from vfguide.regular_file import PipeOrDeviceError, open_regular

GREATEST_ZOOM = 24
"""Zoom of the smallest tiles, which are some metres wide."""

ONLINE_ZOOM = 19
"""Greatest zoom of a server's tiles; most servers have no more."""

LARGEST_TILE = 1024**2
"""Largest tile in bytes; usual ones have 10 to 100 kB."""

LOOKUP_STEPS = 1000
"""Limit for finding a tile, in 1000 SQLite instructions; an indexed lookup takes a few hundred in all."""

OPENING_STEPS = 100_000
"""Limit for a query of the whole file, in thousands of SQLite instructions: some seconds."""

LONGEST_ATTRIBUTION, LONGEST_MARKUP = 200, 2000
"""Characters of the attribution that are shown, and that are read with its tags."""

LOOKUP_S, OPENING_S = 0.5, 10.0
"""Time limits for finding a tile, and for each query of the whole file."""

FUNCTIONS = frozenset({"min", "max"})
"""Functions allowed in queries; others in the file's views could run for ever."""

KINDS = {b"\x89PNG\r\n\x1a\n": "image/png", b"\xff\xd8\xff": "image/jpeg"}
"""Media types of images, by their first bytes."""

SQLITE_BEGINNING = b"SQLite format 3\x00"

LOCAL_TILES = "/tiles/{z}/{x}/{y}"
"""Path at which the console serves a file's tiles."""

IN_ADDRESS = re.compile(r"https://[A-Za-z0-9.-]+(:\d{1,5})?/[A-Za-z0-9._~/?&=%{}+@-]*")
"""Address that is safe in a content security policy: nothing in it can end the policy."""

REMEDY = (
    "give an MBTiles file of PNG or JPEG tiles, or an address such as https://host/{z}/{x}/{y}.png"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tile:
    """Image of one map tile."""

    kind: str
    data: bytes


FindTile = Callable[[int, int, int], Tile | None]
"""Function that finds a tile by zoom, column from the west and row from the north; None without a tile."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TileSource:
    """Source of a page's map."""

    template: str
    """Address of a tile, with {z}, {x} and {y}."""
    least_zoom: int
    greatest_zoom: int
    attribution: str
    """Plain text to show beside the map."""
    find: FindTile | None = None
    """Function that finds a tile; None for tiles of another server."""

    @property
    def origin(self) -> str:
        """Source of the images for a content security policy."""
        if self.find is not None:
            return "'self'"
        parts = urlsplit(self.template)
        return f"{parts.scheme}://{parts.netloc}"

    def describe(
        self, latitude_deg: float, longitude_deg: float, altitude_m: float
    ) -> dict[str, object]:
        """Return what a page needs to draw the map below a local frame, ready for JSON.

        The position is the frame's origin, its altitude above mean sea level.
        """
        return {
            "template": self.template,
            "least_zoom": self.least_zoom,
            "greatest_zoom": self.greatest_zoom,
            "attribution": self.attribution,
            "latitude_deg": latitude_deg,
            "longitude_deg": longitude_deg,
            "north_radius_m": float(pymap3d.rcurve.meridian(latitude_deg)) + altitude_m,
            "east_radius_m": float(pymap3d.rcurve.transverse(latitude_deg)) + altitude_m,
        }


def open_tiles(given: str) -> TileSource:
    """Open the tiles of a file or a server.

    Raises:
        InputError: the source cannot be used; one line with the remedy.
    """
    return tiles_online(given) if "://" in given else TileFile(Path(given)).source


def tiles_online(address: str) -> TileSource:
    """Return the tiles of a server.

    Raises:
        InputError: the address is not valid.
    """
    places = re.findall(r"\{(.*?)\}", address)
    if not IN_ADDRESS.fullmatch(address) or sorted(places) != ["x", "y", "z"]:
        raise InputError(
            f"--tiles {address[:100]}: is no https address with {{z}}, {{x}} and {{y}}; {REMEDY}"
        )
    host = urlsplit(address).netloc
    return TileSource(
        template=address, least_zoom=0, greatest_zoom=ONLINE_ZOOM, attribution=f"map: {host}"
    )


class TileFile:
    """MBTiles file."""

    def __init__(self, path: Path) -> None:
        """Open the file.

        Raises:
            InputError: the file is missing, or holds no tiles that can be used.
        """
        self._path = path
        self._check_beginning()
        try:
            # One thread reads the file, but the garbage collector may close it from another.
            self._file = sqlite3.connect(
                f"file:{quote(str(path.absolute()))}?mode=ro&immutable=1",
                uri=True,
                check_same_thread=False,
            )
            weakref.finalize(self, self._file.close)
            self._file.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, LARGEST_TILE)
            self._file.executescript("PRAGMA query_only = ON; PRAGMA trusted_schema = OFF;")
            self._file.set_authorizer(authorize)
            said = self._metadata()
            sample = self._row("SELECT tile_data FROM tiles LIMIT 1", most_steps=OPENING_STEPS)
            least, greatest = self._zoom(said, "min"), self._zoom(said, "max")
        except (sqlite3.Error, OverflowError) as error:
            raise self._fault(f"cannot be read as map tiles ({error})") from error
        if not (
            least is not None and greatest is not None and 0 <= least <= greatest <= GREATEST_ZOOM
        ):
            raise self._fault("holds no tiles of a zoom from 0 to 24")
        if sample is None or picture_of(sample[0]) is None:
            raise self._fault(f"holds {shown(said.get('format', 'other'), 20)} tiles, not pictures")
        self.source = TileSource(
            template=LOCAL_TILES,
            least_zoom=least,
            greatest_zoom=greatest,
            attribution=shown(
                re.sub(r"<[^>]*>", "", said.get("attribution", "")[:LONGEST_MARKUP]),
                LONGEST_ATTRIBUTION,
            ),
            find=self.find,
        )
        """Map source for the console's pages."""

    def find(self, zoom: int, column: int, row: int) -> Tile | None:
        """Return a tile by zoom, column from the west and row from the north; None without an image."""
        if not (0 <= zoom <= GREATEST_ZOOM and 0 <= column < 2**zoom and 0 <= row < 2**zoom):
            return None
        try:
            found = self._row(
                "SELECT tile_data FROM tiles WHERE zoom_level = ? AND tile_column = ? AND tile_row = ?",
                (zoom, column, 2**zoom - 1 - row),
            )
        except sqlite3.Error:
            return None
        return None if found is None else picture_of(found[0])

    def _check_beginning(self) -> None:
        try:
            with open_regular(self._path) as file:
                beginning = file.read(len(SQLITE_BEGINNING))
        except PipeOrDeviceError:
            raise self._fault("is a pipe or a device") from None
        except OSError as error:
            raise self._fault(f"cannot be read ({error.strerror})") from error
        if beginning != SQLITE_BEGINNING:
            raise self._fault("is no MBTiles file")

    def _row(
        self, query: str, values: tuple[int, ...] = (), *, most_steps: int = LOOKUP_STEPS
    ) -> tuple[object, ...] | None:
        """Return the first row of a query; raise sqlite3.Error if it takes too long."""
        steps = 0
        ends_s = monotonic() + (LOOKUP_S if most_steps == LOOKUP_STEPS else OPENING_S)

        def count() -> bool:
            nonlocal steps
            steps += 1
            return steps > most_steps or monotonic() > ends_s

        self._file.set_progress_handler(count, 1000)
        try:
            with closing(self._file.execute(query, values)) as found:
                row: tuple[object, ...] | None = found.fetchone()
        except UnicodeDecodeError as error:
            # SQLite reports a damaged schema in the schema's own bytes.
            raise sqlite3.DatabaseError("its tables are damaged") from error
        return row

    def _metadata(self) -> dict[str, str]:
        said = {}
        for name in ("format", "attribution", "minzoom", "maxzoom"):
            with suppress(sqlite3.Error):
                row = self._row(f"SELECT value FROM metadata WHERE name = '{name}'")  # noqa: S608
                if row is not None and isinstance(row[0], str | int):
                    said[name] = str(row[0])
        return said

    def _zoom(self, said: dict[str, str], which: str) -> int | None:
        """Return the least (`min`) or greatest (`max`) zoom, from the metadata or else from the tiles."""
        if re.fullmatch(r"\d{1,2}", text := said.get(f"{which}zoom", "")):
            return int(text)
        row = self._row(f"SELECT {which}(zoom_level) FROM tiles", most_steps=OPENING_STEPS)  # noqa: S608
        return row[0] if row is not None and isinstance(row[0], int) else None

    def _fault(self, what: str) -> InputError:
        return InputError(f"--tiles {self._path}: {shown(what, 200)}; {REMEDY}")


def authorize(action: int, _table: str | None, name: str | None, *_: str | None) -> int:
    """Allow a query to read tables and views and to call fast functions; return SQLite's codes."""
    allowed = action in {sqlite3.SQLITE_SELECT, sqlite3.SQLITE_READ} or (
        action == sqlite3.SQLITE_FUNCTION and name in FUNCTIONS
    )
    return sqlite3.SQLITE_OK if allowed else sqlite3.SQLITE_DENY


def picture_of(data: object) -> Tile | None:
    """Return an image by its first bytes; None if it is none or too large."""
    if not isinstance(data, bytes) or len(data) > LARGEST_TILE:
        return None
    kind = next((kind for beginning, kind in KINDS.items() if data.startswith(beginning)), None)
    return None if kind is None else Tile(kind=kind, data=data)


def shown(text: str, longest: int) -> str:
    """Make foreign text safe to show in one line."""
    return "".join(letter if letter.isprintable() else " " for letter in text)[:longest].strip()
