"""Reading mission files: a mission that can be flown, or everything that is wrong with the file."""

import copy
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from vfguide.errors import InputError
from vfguide.mission.explain import explain
from vfguide.mission.finding import Finding, MissionError
from vfguide.mission.flight_path import Location, Misfit, MissionSource
from vfguide.mission.model import Mission
from vfguide.mission.plan_file import read_plan
from vfguide.mission.yaml_tree import MAX_NODES, Tree, read_tree
from vfguide.regular_file import PipeOrDeviceError, open_regular

MAX_BYTES = 1024 * 1024
"""Far beyond any mission; what is larger is something else."""

DEFAULTS = "defaults"
"""Under `vehicles`: what all of them have that do not say otherwise."""

PACKAGE = Path(__file__).parents[1]

SHIPPED_IN = (PACKAGE / "missions", PACKAGE.parent / "missions")
"""Where the missions that come along are: in an installed wheel, and in a checkout."""


@dataclass(frozen=True, slots=True)
class LoadedMission:
    """A mission, and where in its file everything stands."""

    mission: Mission
    """What the file says."""
    source: MissionSource
    """The file and the line of each field, for later findings."""


def shipped_missions() -> dict[str, Path]:
    """Files of the missions that come along, by name, such as `circle-wind`."""
    place = next((place for place in SHIPPED_IN if place.is_dir()), None)
    files = [] if place is None else sorted(place.glob("*.yaml"))
    return {file.stem: file for file in files}


def load_mission(path: Path) -> Mission:
    """Read a mission file, or the mission of this name that comes along.

    Raises:
        MissionError: the file cannot be read, or is no mission; lists every fault found.
    """
    return read_mission(path).mission


def read_mission(path: Path) -> LoadedMission:
    """Read a mission file, and keep where in it each field stands.

    Raises:
        MissionError: the file cannot be read, or is no mission; lists every fault found.
    """
    return parse_mission(_read_bytes(path), file=str(path))


def parse_mission(content: bytes, *, file: str) -> LoadedMission:
    """Read a mission from the bytes of a file.

    Args:
        content: what the file holds.
        file: the name messages give it.

    Raises:
        MissionError: the bytes are no mission; lists every fault found.
    """
    tree = read_tree(_decode(content, file), file)
    if not isinstance(tree.data, dict):
        found = "is empty" if tree.data is None else "holds no group of fields"
        raise _error(
            file, f"the file {found}", "begin with name: …; see the missions that come along"
        )
    spread = spread_defaults(tree, file)
    source = MissionSource(file, tree.lines)
    _read_plans_of(tree.data, source)
    faults = [*tree.faults]
    mission = None
    try:
        mission = Mission.model_validate(tree.data)
    except ValidationError as error:
        faults += [fault_of(source, one) for one in explain(error, tree.data)]
        faults = [*dict.fromkeys(where_it_stands(one, spread) for one in faults)]
    if mission is None or faults:
        raise MissionError(_in_order(faults))
    return LoadedMission(mission, source)


def _read_plans_of(data: dict[str, Any], source: MissionSource) -> None:
    """Read the plans that the paths of a mission name, which lie beside the mission's file.

    Raises:
        MissionError: one cannot be read, or is no plan.
    """
    if "path" in data:
        data["path"] = _with_plan(data["path"], ("path",), source)
    others = data.get("paths")
    if isinstance(others, dict):
        for name, path in others.items():
            others[name] = _with_plan(path, ("paths", str(name)), source)


def _with_plan(path: object, place: Location, source: MissionSource) -> object:
    """A path with what is in the plan that it names; any other as it is.

    Raises:
        MissionError: the plan cannot be read, or is none.
    """
    if not isinstance(path, dict) or path.get("type") != "plan" or "contents" in path:
        return path
    name = path.get("file")
    if not isinstance(name, str):
        return path
    try:
        # A mission that comes along is known by its name alone.
        mission = Path(source.file)
        beside = mission if mission.exists() else shipped_missions().get(source.file, mission)
        contents = read_plan(beside.parent / name)
    except InputError as error:
        message, _, remedy = str(error).rpartition("; ")
        misfit = Misfit((*place, "file"), message, remedy)
        raise MissionError((fault_of(source, misfit),)) from error
    return {**path, "contents": {"file": name, **contents}}


def spread_defaults(tree: Tree, file: str) -> dict[Location, Location]:
    """Put the fields of `vehicles.defaults` into every vehicle that does not have them itself.

    Returns:
        Where each such field of a vehicle really stands.

    Raises:
        MissionError: there are too many of them.
    """
    vehicles = tree.data.get("vehicles") if isinstance(tree.data, dict) else None
    defaults = vehicles.get(DEFAULTS) if isinstance(vehicles, dict) else None
    if not isinstance(vehicles, dict) or not isinstance(defaults, dict):
        return {}
    place = ("vehicles", DEFAULTS)
    lines = [(at[2:], line) for at, line in tree.lines.items() if at[:2] == place and at != place]
    if len(vehicles) * len(lines) > MAX_NODES:
        raise _error(file, f"more than {MAX_NODES} entries", "this is no mission file")
    del vehicles[DEFAULTS]
    spread: dict[Location, Location] = {}
    for name, vehicle in vehicles.items():
        if vehicle is not None and not isinstance(vehicle, dict):
            continue
        own = vehicle or {}
        vehicles[name] = {**copy.deepcopy(defaults), **own}
        for (field, *rest), line in lines:
            if field not in own:
                spread["vehicles", name, field] = (*place, field)
                tree.lines["vehicles", name, field, *rest] = line
    return spread


def where_it_stands(fault: Finding, spread: Mapping[Location, Location]) -> Finding:
    """The fault of a vehicle's field at the place in the file that it comes from."""
    place = spread.get(fault.location[:3])
    return fault if place is None else replace(fault, location=(*place, *fault.location[3:]))


def _read_bytes(path: Path) -> bytes:
    file = str(path)
    try:
        with open_regular(path) as stream:
            content = stream.read(MAX_BYTES + 1)
    except FileNotFoundError as error:
        shipped = shipped_missions()
        if file in shipped:
            return _read_bytes(shipped[file])
        remedy = f"give the path of a mission file, or one of these names: {', '.join(shipped)}"
        raise _error(file, "there is no such file", remedy) from error
    except PipeOrDeviceError as error:
        raise _error(file, str(error.strerror), "give the path of a mission file") from error
    except IsADirectoryError as error:
        raise _error(file, "this is a directory", "give the path of a mission file") from error
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise _error(file, f"cannot be read: {reason}", "check its path and permissions") from error
    if len(content) > MAX_BYTES:
        raise _error(file, "larger than 1 MiB", "this is no mission file")
    return content


def _decode(content: bytes, file: str) -> str:
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise _error(file, "not UTF-8 text", "save the file as UTF-8", line) from error


def fault_of(source: MissionSource, misfit: Misfit) -> Finding:
    """A misfit with its line in the file."""
    return Finding("error", misfit.location, misfit.message, misfit.remedy).placed(source)


def _error(file: str, message: str, remedy: str, line: int | None = None) -> MissionError:
    return MissionError((Finding("error", (), message, remedy, file, line),))


def _in_order(faults: list[Finding]) -> tuple[Finding, ...]:
    return tuple(sorted(faults, key=lambda fault: fault.line or 0))
