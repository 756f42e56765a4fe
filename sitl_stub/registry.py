"""Registries of plants and autopilots: the emulator's, those of installed packages and of user files."""

import importlib.util
import sys
import zlib
from collections.abc import Callable, Sequence
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any, TypeVar

Kind = TypeVar("Kind", bound="type[Any]")


class PlugInRegistry:
    """Classes of one kind by name; those of installed packages are imported on first use."""

    def __init__(self, kind: str, *, group: str, has: Sequence[str]) -> None:
        """Make an empty registry.

        Args:
            kind: name of the kind for messages, such as "a plant".
            group: entry point group of installed packages, such as "sitl_stub.plants".
            has: attributes that every class must have.
        """
        self._kind = kind
        self._group = group
        self._has = has
        self._known: dict[str, type[Any]] = {}

    def register(self, name: str) -> Callable[[Kind], Kind]:
        """Return a decorator that registers a class by a name.

        Raises:
            ValueError: another class has this name already, or an attribute is missing.
        """

        def add(found: Kind) -> Kind:
            known = self._known.get(name)
            taken = known is not None and (known.__module__, known.__qualname__) != (
                found.__module__,
                found.__qualname__,
            )
            if taken:
                raise ValueError(
                    f"{name}: there is {self._kind} of this name already; choose another"
                )
            missing = [one for one in self._has if not hasattr(found, one)]
            missing += sorted(getattr(found, "__abstractmethods__", ()))
            if missing:
                raise ValueError(f"the class of {name} has no {', '.join(missing)}; write it")
            # In a notebook the same class may be defined again.
            self._known[name] = found
            return found

        return add

    def names(self) -> tuple[str, ...]:
        """Return all known names: loaded classes in order of registration, then packages' by name."""
        return (*self._known, *sorted(installed(self._group).keys() - self._known.keys()))

    def __contains__(self, name: object) -> bool:
        """Check whether a name is known."""
        return name in self._known or name in installed(self._group)

    def find(self, name: str) -> type[Any]:
        """Return the class of a name.

        Raises:
            ValueError: there is none, or its package cannot be loaded; the message is one line.
        """
        if name not in self._known and name in installed(self._group):
            self.register(name)(loaded(installed(self._group)[name]))
        if name not in self._known:
            raise ValueError(f"{name} is not one of {', '.join(self.names())}")
        return self._known[name]


@cache
def installed(group: str) -> dict[str, EntryPoint]:
    """Return the entry points of installed packages, by name."""
    return {one.name: one for one in entry_points(group=group)}


def loaded(entry: EntryPoint) -> Any:  # noqa: ANN401 - a class of whatever kind
    """Load the class of an installed package.

    Raises:
        ValueError: it cannot be loaded.
    """
    try:
        return entry.load()
    except Exception as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise ValueError(
            f"{entry.name}: {entry.value} of an installed package cannot be loaded ({reason}); mend it"
        ) from error


def load_plugins(files: Sequence[str | Path]) -> None:
    """Load Python files with the user's plants and autopilots, each file once.

    Raises:
        ValueError: a file cannot be loaded; the message is one line.
    """
    for file in map(Path, files):
        name = f"sitl_stub_plugin_{file.stem}_{zlib.crc32(str(file.resolve()).encode()):08x}"
        if name in sys.modules:
            continue
        spec = importlib.util.spec_from_file_location(name, file)
        if spec is None or spec.loader is None or not file.is_file():
            raise ValueError(f"{file}: there is no such file of Python")
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module
        try:
            spec.loader.exec_module(module)
        except (Exception, SystemExit) as error:
            del sys.modules[name]
            reason = " ".join(f"{type(error).__name__}: {error}".split())
            raise ValueError(f"{file}: {reason}; mend the file") from error
