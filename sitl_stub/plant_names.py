"""The names of the aircraft that can be flown; `plants` and files of one's own fill it."""

from typing import Any

PLANTS: dict[str, type[Any]] = {}
"""Subclasses of `plants.Plant` by name."""
