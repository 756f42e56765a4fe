"""Registry of extensible classes by name.

Laws, paths, links and autopilots are part of vfguide, entry points of installed packages, or in a file that
the user names (`--plugin FILE`). A mission file only has names: it never causes a file to be loaded.
"""

import importlib
import importlib.util
import os
import sys
import zlib
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any, TypeVar

from vfguide.errors import InputError

PLUGINS_VARIABLE = "VFGUIDE_PLUGINS"
"""Environment variable with the files of `--plugin`, so that other processes of a flight load them too."""

Kind = TypeVar("Kind", bound=type[Any])


class Registry:
    """Classes of one kind by name."""

    def __init__(
        self, kind: str, *, group: str, own: Mapping[str, str], has: Sequence[str] = ()
    ) -> None:
        """Create a registry that has loaded no class yet.

        Args:
            kind: kind of the classes for messages, such as "law".
            group: entry point group of installed packages, such as "vfguide.laws".
            own: module of each of vfguide's own classes, by name.
            has: attributes that every class needs.
        """
        self._has = has
        self._kind = kind
        self._group = group
        self.own = own
        """Module of each of vfguide's own classes, by name."""
        self._known: dict[str, type[Any]] = {}

    def register(self, name: str) -> Callable[[Kind], Kind]:
        """Return a decorator that registers a class under a name.

        Raises:
            InputError: the name belongs to another class, or the class lacks a required attribute.
        """

        def add(found: Kind) -> Kind:
            known = self._known.get(name)
            taken = known is not None and not same_class(known, found)
            if taken or self.own.get(name, found.__module__) != found.__module__:
                raise InputError(
                    f"{name}: there is a {self._kind} of this name already; choose another"
                )
            for attribute in self._has:
                if not hasattr(found, attribute):
                    raise InputError(f"the {self._kind} {name} has no {attribute}; write it")
            missing = sorted(getattr(found, "__abstractmethods__", ()))
            if missing:
                raise InputError(f"the {self._kind} {name} has no {', '.join(missing)}; write it")
            found.name = name
            self._known[name] = found
            return found

        return add

    def names(self) -> tuple[str, ...]:
        """Return all known names: vfguide's own in their order, then the others sorted."""
        load_plugins_of_the_environment()
        others = ({*installed(self._group)} | set(self._known)) - set(self.own)
        return (*self.own, *sorted(others))

    def __contains__(self, name: object) -> bool:
        """Check whether there is a class of this name."""
        if not isinstance(name, str):
            return False
        return name in self.own or name in self._known or name in self.names()

    def find(self, name: str) -> type[Any]:
        """Return the class of this name, loading it if necessary.

        Raises:
            InputError: there is none; the message lists the known names.
        """
        if name not in self._known and name in self.own:
            importlib.import_module(self.own[name])
        if name not in self._known:
            load_plugins_of_the_environment()
        if name not in self._known and name in installed(self._group):
            self.register(name)(loaded(installed(self._group)[name]))
        if name not in self._known:
            names = ", ".join(self.names())
            raise InputError(f"{name}: there is no such {self._kind}; known are {names}")
        return self._known[name]


@cache
def installed(group: str) -> dict[str, EntryPoint]:
    """Return the entry points of installed packages by name."""
    return {one.name: one for one in entry_points(group=group)}


def loaded(entry: EntryPoint) -> Any:  # noqa: ANN401 - a class of whatever kind
    """Load an entry point of an installed package.

    Raises:
        InputError: it cannot be loaded.
    """
    try:
        return entry.load()
    except Exception as error:
        reason = f"{type(error).__name__}: {error}"
        raise InputError(
            f"{entry.name}: {entry.value} of an installed package cannot be loaded ({reason}); mend it"
        ) from error


def same_class(one: type[Any], other: type[Any]) -> bool:
    """Check whether a class was only imported again, as in a notebook or a started process."""
    running = {"__main__", "__mp_main__"}
    same_file = one.__module__ == other.__module__ or {one.__module__, other.__module__} <= running
    return same_file and one.__qualname__ == other.__qualname__


laws = Registry(
    "law",
    group="vfguide.laws",
    has=("Gains", "step"),
    own={
        "slot": "vfguide.laws.field",
        "article": "vfguide.laws.field",
        "pid": "vfguide.laws.pid",
        "mpc": "vfguide.laws.mpc",
    },
)
"""Laws by which followers keep their slots."""

leader_laws = Registry(
    "leader's law",
    group="vfguide.leader_laws",
    has=("Gains", "step"),
    own={"field": "vfguide.laws.leader"},
)
"""Laws by which the leader follows its path."""

paths = Registry(
    "path",
    group="vfguide.paths",
    has=("Shape", "of", "nearest", "at"),
    own={
        "line": "vfguide.paths.line",
        "circle": "vfguide.paths.circle",
        "helix": "vfguide.paths.circle",
        "racetrack": "vfguide.paths.racetrack",
        "figure-eight": "vfguide.paths.racetrack",
        "waypoints": "vfguide.paths.waypoints",
        "plan": "vfguide.paths.waypoints",
    },
)
"""Paths of leaders."""

links = Registry(
    "link",
    group="vfguide.links",
    has=("address_of", "run"),
    own={
        "mqtt": "vfguide.link.mqtt",
        "mqtts": "vfguide.link.mqtt",
        "udp": "vfguide.link.udp",
        "zenoh": "vfguide.link.zenoh",
        "serial": "vfguide.link.radio",
    },
)
"""Carriers of a formation's messages, by URL scheme."""

autopilots = Registry(
    "autopilot",
    group="vfguide.autopilots",
    has=("fly", "hand_back"),
    own={
        "auto": "vfguide.mavlink.adapter",
        "ardupilot": "vfguide.mavlink.ardupilot",
        "px4": "vfguide.mavlink.px4",
        "mavsdk": "vfguide.mavlink.px4",
    },
)
"""Adapters of autopilots."""


class EmulatorNames:
    """Names of the emulator's classes, for missions; a companion does not import the emulator."""

    def __init__(self, kind: str, own: Sequence[str]) -> None:
        """Take the name of the emulator's registry, such as "plants", and its own names."""
        self._kind = kind
        self.own = own
        """Names that are part of the emulator."""

    def names(self) -> tuple[str, ...]:
        """Return all known names: the emulator's own in their order, then the others sorted."""
        load_plugins_of_the_environment()
        # Plugin files import the emulator and add to its registry.
        emulator = sys.modules.get("sitl_stub")
        known = getattr(emulator, self._kind).names() if emulator else ()
        added = {*installed(f"sitl_stub.{self._kind}"), *known}
        return (*self.own, *sorted(added - set(self.own)))

    def __contains__(self, name: object) -> bool:
        """Check whether a name is known."""
        return name in self.own or name in self.names()


plants = EmulatorNames("plants", ("course-hold", "heading-hold", "bank", "npfg", "six-dof"))
"""Aircraft types that emulators fly."""

emulated_autopilots = EmulatorNames("autopilots", ("ardupilot", "px4"))
"""Autopilot types that emulators implement."""


def plugin_files() -> list[str]:
    """Return the plugin files given to this process or its parent."""
    return [*filter(None, os.environ.get(PLUGINS_VARIABLE, "").split(os.pathsep))]


def use_plugins(files: Sequence[Path]) -> None:
    """Load plugin files, here and in every process that this one starts.

    Raises:
        InputError: a file cannot be loaded.
    """
    if not files:
        return
    paths = [str(file.resolve()) for file in files]
    os.environ[PLUGINS_VARIABLE] = os.pathsep.join(dict.fromkeys([*plugin_files(), *paths]))
    load_plugins_of_the_environment()


def load_plugins_of_the_environment() -> None:
    """Load the plugin files given to this process or its parent, each once.

    Raises:
        InputError: a file cannot be loaded.
    """
    for path in plugin_files():
        load_file(Path(path))


def load_file(file: Path) -> None:
    """Import a Python file as a module, once.

    Raises:
        InputError: there is no such file, or it fails; the message is one line.
    """
    name = f"vfguide_plugin_{file.stem}_{zlib.crc32(str(file).encode()):08x}"
    if name in sys.modules:
        return
    spec = importlib.util.spec_from_file_location(name, file)
    if spec is None or spec.loader is None or not file.is_file():
        raise InputError(
            f"--plugin {file}: there is no such file of Python; give the path of a .py"
        )
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except InputError as error:
        del sys.modules[name]
        raise InputError(f"--plugin {file}{line_in(error, file)}: {error}") from error
    except (Exception, SystemExit) as error:
        del sys.modules[name]
        place = line_in(error, file)
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise InputError(f"--plugin {file}{place}: {reason}; mend the file") from error


def plugin_fault(error: BaseException) -> str | None:
    """Return an exception from a plugin file in one line; None if no plugin file caused it."""
    for path in plugin_files():
        place = line_in(error, Path(path))
        if place:
            reason = " ".join(f"{type(error).__name__}: {error}".split())
            return f"--plugin {path}{place}: {reason}; mend the file"
    return None


def line_in(error: BaseException, file: Path) -> str:
    """Return `:LINE` of a file's innermost line that led to an error; empty if there is none."""
    line = getattr(error, "lineno", None) if isinstance(error, SyntaxError) else None
    trace = error.__traceback__
    while trace is not None:
        if trace.tb_frame.f_code.co_filename == str(file):
            line = trace.tb_lineno
        trace = trace.tb_next
    return "" if line is None else f":{line}"
