"""Reader of mission files: returns a mission that can be flown, or reports all faults of the file."""

import copy
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from pydantic import ValidationError

from vfguide.errors import InputError
from vfguide.mission.consistency import as_written, inconsistencies
from vfguide.mission.explain import explain
from vfguide.mission.finding import Finding, Location, Misfit, MissionError, MissionSource
from vfguide.mission.model import Mission
from vfguide.mission.overrides import DEFAULTS, Overrides, overridden
from vfguide.mission.plan_file import read_plan
from vfguide.mission.yaml_tree import MAX_NODES, Tree, read_tree
from vfguide.regular_file import PipeOrDeviceError, open_regular

MAX_BYTES = 1024 * 1024
"""Size limit, far beyond any mission."""

PACKAGE = Path(__file__).parents[1]

AS_WRITTEN = Overrides()
"""No overrides: the mission as its file has it."""

SHIPPED_IN = (PACKAGE / "missions", PACKAGE.parent / "missions")
"""Directories of the shipped missions: in an installed wheel, and in a checkout."""


@dataclass(frozen=True, slots=True)
class LoadedMission:
    """Mission and the positions of its fields in the file."""

    mission: Mission
    source: MissionSource
    """File and line of each field, for later findings."""


def shipped_missions() -> dict[str, Path]:
    """Return the files of the shipped missions by name, such as `circle-wind`."""
    place = next((place for place in SHIPPED_IN if place.is_dir()), None)
    files = [] if place is None else sorted(place.glob("*.yaml"))
    return {file.stem: file for file in files}


def load_mission(path: Path) -> Mission:
    """Read a mission file, or the shipped mission of this name.

    Raises:
        MissionError: the file cannot be read, or is no mission; lists every fault found.
    """
    return read_mission(path).mission


def read_mission(path: Path, overrides: Overrides = AS_WRITTEN) -> LoadedMission:
    """Read a mission file, or a shipped mission by name, with the line of each field.

    Raises:
        MissionError: the file cannot be read, or is no mission; lists every fault found.
        InputError: an option names no law.
    """
    return parse_mission(_read_bytes(path), file=str(path), overrides=overrides)


def parse_mission(content: bytes, *, file: str, overrides: Overrides = AS_WRITTEN) -> LoadedMission:
    """Read a mission from the bytes of a file; messages name the file `file`.

    Raises:
        MissionError: the bytes are no mission; lists every fault found.
        InputError: an option names no law.
    """
    tree = read_tree(_decode(content, file), file)
    if not isinstance(tree.data, dict):
        found = "is empty" if tree.data is None else "holds no group of fields"
        raise _error(
            file, f"the file {found}", "begin with name: …; see the missions that come along"
        )
    spread = spread_defaults(tree, file)
    source = MissionSource(file, tree.lines)
    return _validated(tree.data, source, overrides, spread=spread, faults=tree.faults)


def with_overrides(mission: Mission, overrides: Overrides) -> Mission:
    """Return a mission with fields replaced by command-line values.

    Raises:
        MissionError: the result is no mission; lists every fault found.
        InputError: an option names no law.
    """
    if overrides == AS_WRITTEN:
        return mission
    data = as_written(mission.model_dump(exclude_unset=True))
    return _validated(data, MissionSource(None), overrides).mission


def _validated(
    data: dict[str, Any],
    source: MissionSource,
    overrides: Overrides,
    *,
    spread: Mapping[Location, Location] = MappingProxyType({}),
    faults: Iterable[Finding] = (),
) -> LoadedMission:
    """Validate the mission that a file and the command line make together.

    `spread` gives the location under `vehicles.defaults` of each vehicle field that comes from there.
    `faults` are those of the file found so far.

    Raises:
        MissionError: the result is no mission; lists every fault found.
        InputError: an option names no law.
    """
    changed = overridden(data, overrides)
    source = replace(source, options=changed.options)
    _read_plans_of(changed.data, source)
    found = [*faults, *changed.faults]
    mission = None
    try:
        mission = Mission.model_validate(changed.data)
    except ValidationError as error:
        misfits = explain(error, changed.data)
        new = {*inconsistencies(changed.data)} - {*inconsistencies(data)}
        for one in misfits:
            fault = where_it_stands(fault_of(source, one), spread)
            if fault.option is None and (cause := cause_in(source, one, between=one in new)):
                fault = replace(fault, message=f"{fault.message} (with {cause})")
            found.append(fault)
    if mission is None or found:
        raise MissionError(_in_order(dict.fromkeys(found)))
    return LoadedMission(mission, source)


def cause_in(source: MissionSource, misfit: Misfit, *, between: bool) -> str:
    """Return the options, comma-separated, that may have caused a misfit of a field they did not set.

    `between` tells whether the field contradicts others that agreed without the options.
    """
    at, options = misfit.location, source.options.items()
    near = [name for place, name in options if at[: len(place) - 1] == place[:-1]]
    if between:
        near = [name for place, name in options if at[:1] == place[:1]] or [
            *source.options.values()
        ]
    return ", ".join(dict.fromkeys(near))


def _read_plans_of(data: dict[str, Any], source: MissionSource) -> None:
    """Read the plans that the mission's paths name, relative to the mission's file.

    Raises:
        MissionError: a plan cannot be read, or is no plan.
    """
    if "path" in data:
        data["path"] = _with_plan(data["path"], ("path",), source)
    others = data.get("paths")
    if isinstance(others, dict):
        for name, path in others.items():
            others[name] = _with_plan(path, ("paths", str(name)), source)


def _with_plan(path: object, place: Location, source: MissionSource) -> object:
    """Return a path with the content of the plan it names; any other path unchanged.

    Raises:
        MissionError: the plan cannot be read, or is no plan.
    """
    if not isinstance(path, dict) or path.get("type") != "plan" or "contents" in path:
        return path
    name = path.get("file")
    # A plan from the command line is relative to the working directory and is read with its path.
    if not isinstance(name, str) or source.file is None or source.option_of((*place, "file")):
        return path
    try:
        # A shipped mission may be given by its name alone.
        mission = Path(source.file)
        beside = mission if mission.exists() else shipped_missions().get(source.file, mission)
        contents = read_plan(beside.parent / name)
    except InputError as error:
        message, _, remedy = str(error).rpartition("; ")
        misfit = Misfit((*place, "file"), message, remedy)
        raise MissionError((fault_of(source, misfit),)) from error
    return {**path, "contents": {"file": name, **contents}}


def spread_defaults(tree: Tree, file: str) -> dict[Location, Location]:
    """Copy the fields of `vehicles.defaults` into every vehicle that lacks them.

    Returns:
        Location of the default for each copied field.

    Raises:
        MissionError: there are too many fields.
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
    """Return a vehicle's fault at the location in the file that its field comes from."""
    place = None if fault.option else spread.get(fault.location[:3])
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
    """Return a misfit as an error finding with its line in the file."""
    return Finding("error", misfit.location, misfit.message, misfit.remedy).placed(source)


def _error(file: str, message: str, remedy: str, line: int | None = None) -> MissionError:
    return MissionError((Finding("error", (), message, remedy, file, line),))


def _in_order(faults: Iterable[Finding]) -> tuple[Finding, ...]:
    return tuple(sorted(faults, key=lambda fault: fault.line or 0))
