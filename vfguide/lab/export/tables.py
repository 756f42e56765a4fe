"""Flights as tables, a row for each vehicle at each sample: comma-separated values and Parquet.

For spreadsheets, MATLAB, pandas, Polars and DuckDB; the columns of both are the same.
"""

import csv
import math
from pathlib import Path

from vfguide.lab.export.columns import UNITS, begin_of, moment, parts_of
from vfguide.record.flight import FlightRecord

FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r")


def write_csv(record: FlightRecord, path: Path) -> None:
    """Write a flight; units are in the names of the columns, and what is not known is left empty.

    Raises:
        OSError: it cannot be written.
        InputError: the record does not say where on the earth it was flown.
    """
    begin = begin_of(record)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("time_s", "time_utc", "vehicle", *UNITS, "mode", "limited"))
        for part in parts_of(record):
            name = harmless(part.vehicle.name)
            columns = [values.tolist() for values in part.numbers.values()]
            for time_s, mode, limited, *numbers in zip(
                part.time_s.tolist(), part.modes, part.limited, *columns, strict=True
            ):
                writer.writerow(
                    (
                        f"{time_s:.3f}",
                        moment(begin + time_s),
                        name,
                        *(plain(number) for number in numbers),
                        harmless(mode),
                        int(limited),
                    )
                )


def plain(number: float) -> str:
    """A number with as many digits as tell millimetres of a position on the earth; nothing if not known."""
    return f"{number:.9g}" if math.isfinite(number) else ""


def harmless(text: str) -> str:
    """A name that no spreadsheet takes for a formula."""
    return f"'{text}" if text.startswith(FORMULA_STARTS) else text


def write_parquet(record: FlightRecord, path: Path) -> None:
    """Write a flight; the unit of each column is in its metadata, and what is not known is null.

    Raises:
        OSError: it cannot be written.
        InputError: the record does not say where on the earth it was flown.
    """
    import pyarrow as pa
    from pyarrow import parquet

    begin = begin_of(record)
    text = pa.dictionary(pa.int32(), pa.string())
    schema = pa.schema(
        [
            pa.field("time_s", pa.float64(), metadata={"unit": "s of the flight"}),
            pa.field("time_utc", pa.timestamp("us", tz="UTC")),
            pa.field("vehicle", text),
            *(
                pa.field(name, pa.float64(), metadata={"unit": unit})
                for name, unit in UNITS.items()
            ),
            pa.field("mode", text),
            pa.field("limited", pa.bool_()),
        ],
        metadata={"mission": record.mission},
    )
    with parquet.ParquetWriter(path, schema, compression="zstd") as writer:
        for part in parts_of(record):
            names = pa.array([part.vehicle.name] * part.time_s.size).dictionary_encode()
            moments = ((begin + part.time_s) * 1e6).round().astype("int64")
            columns = [
                pa.array(part.time_s),
                pa.array(moments, pa.int64()).cast(pa.timestamp("us", tz="UTC")),
                names,
                *(pa.array(values, from_pandas=True) for values in part.numbers.values()),
                pa.array(part.modes, pa.string()).dictionary_encode(),
                pa.array(part.limited, pa.bool_()),
            ]
            writer.write_table(pa.Table.from_arrays(columns, schema=schema))
