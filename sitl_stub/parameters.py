"""The parameters of an autopilot: names, types, values; stored until the emulator ends."""

import math
import struct
import zlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Literal


class ParameterType(IntEnum):
    """MAV_PARAM_TYPE, as far as these autopilots use it."""

    UINT32 = 5
    INT8 = 2
    INT16 = 4
    INT32 = 6
    REAL32 = 9


BITS: Mapping[ParameterType, int] = {
    ParameterType.INT8: 8,
    ParameterType.INT16: 16,
    ParameterType.INT32: 32,
}

Encoding = Literal["cast", "bytewise"]
"""How an integer travels in PARAM_VALUE's float: ArduPilot converts it, PX4 copies its bytes."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter."""

    name: str
    """Up to 16 characters."""

    kind: ParameterType
    """How it is stored."""

    default: float
    """Value at the start."""


def real(name: str, default: float) -> Parameter:
    """A floating-point parameter."""
    return Parameter(name, ParameterType.REAL32, default)


def int8(name: str, default: int) -> Parameter:
    """A parameter of 8 bits."""
    return Parameter(name, ParameterType.INT8, default)


def int16(name: str, default: int) -> Parameter:
    """A parameter of 16 bits."""
    return Parameter(name, ParameterType.INT16, default)


def int32(name: str, default: int) -> Parameter:
    """A parameter of 32 bits."""
    return Parameter(name, ParameterType.INT32, default)


def whole_if_possible(name: str, default: float) -> Parameter:
    """An integer on the real autopilot; a float where the configured value would be rounded away."""
    whole = default == round(default)
    return Parameter(name, ParameterType.INT16 if whole else ParameterType.REAL32, default)


class Parameters(Mapping[str, float]):
    """All parameters of one autopilot; names are sorted, and that is their index."""

    def __init__(self, parameters: Iterable[Parameter], encoding: Encoding) -> None:
        self.encoding = encoding
        self._parameters = {one.name: one for one in sorted(parameters, key=lambda one: one.name)}
        self._values = {
            name: stored(one.kind, one.default) for name, one in self._parameters.items()
        }
        self.names = tuple(self._parameters)

    def __getitem__(self, name: str) -> float:
        """The value of a parameter."""
        return self._values[name]

    def __iter__(self) -> Iterator[str]:
        """Names in the order of their indices."""
        return iter(self.names)

    def __len__(self) -> int:
        """How many there are."""
        return len(self.names)

    def kind(self, name: str) -> ParameterType:
        """How a parameter is stored."""
        return self._parameters[name].kind

    def set(self, name: str, value: float) -> bool:
        """Store a value, rounded and bounded as its type wants it; False if it is no number."""
        if not math.isfinite(value):
            return False
        self._values[name] = stored(self.kind(name), value)
        return True

    def encoded(self, name: str) -> float:
        """The value as PARAM_VALUE carries it."""
        value = self._values[name]
        if self.encoding == "cast" or self.kind(name) is ParameterType.REAL32:
            return value
        return float_of_bytes(struct.pack("<i", int(value)))

    def decoded(self, name: str, value: float) -> float:
        """The value that a PARAM_SET carries for a parameter; may be anything."""
        if self.encoding == "cast" or self.kind(name) is ParameterType.REAL32:
            return value
        (number,) = struct.unpack("<i", struct.pack("<f", value))
        return float(number)

    def checksum(self) -> float:
        """A float whose bytes tell whether a list known from before is still right: PX4's _HASH_CHECK."""
        content = "".join(f"{name}={value!r}\n" for name, value in self._values.items())
        return float_of_bytes(struct.pack("<I", zlib.crc32(content.encode("ascii"))))


def stored(kind: ParameterType, value: float) -> float:
    """A finite value as a type holds it: single precision, or a whole number within the type's bounds."""
    if kind is ParameterType.REAL32:
        greatest = struct.unpack("<f", b"\xff\xff\x7f\x7f")[0]
        bounded = max(-greatest, min(greatest, value))
        return float(struct.unpack("<f", struct.pack("<f", bounded))[0])
    half = 2 ** (BITS[kind] - 1)
    return float(max(-half, min(half - 1, round(value))))


def float_of_bytes(four: bytes) -> float:
    """The single-precision float that has these bytes, least significant first."""
    value: float = struct.unpack("<f", four)[0]
    return value
