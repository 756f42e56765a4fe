"""Parquet, the columns of the CSV with their types and units: for pandas, Polars and DuckDB."""

from pathlib import Path

import pyarrow as pa
from pyarrow import parquet

from vfguide.lab.export.columns import UNITS, begin_of, parts_of
from vfguide.record.flight import FlightRecord


def write_parquet(record: FlightRecord, path: Path) -> None:
    """Write a flight; the unit of each column is in its metadata, and what is not known is null.

    Raises:
        OSError: it cannot be written.
        InputError: the record does not say where on the earth it was flown.
    """
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
