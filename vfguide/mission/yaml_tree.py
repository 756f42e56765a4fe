"""YAML reader: plain data with the line of every field.

It supports what a mission file needs: groups, lists, text, numbers, true/false and null, by the rules of
YAML 1.2 that editors follow (`no` and `12:30` are text, `1e3` is a number). An alias is replaced by the
content of its anchor, and `<<: *anchor` merges the anchor's fields into a group. Foreign tags are refused.
Size and depth, with aliases expanded, are bounded, since a mission file may come from anywhere.
"""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import yaml

from vfguide.mission.finding import Finding, Location, MissionError, shortened

MAX_DEPTH = 16
MAX_NODES = 20_000
MAX_DIGITS = 400
MERGE = "<<"
"""Merge key: the fields of its value are added to the group unless the group has them."""

_INTEGER = re.compile(r"[-+]?[0-9]+", re.ASCII)
_HEXADECIMAL = re.compile(r"0x[0-9a-fA-F]+", re.ASCII)
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?", re.ASCII)
_NOT_FINITE = re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
_WORDS: dict[str, bool | None] = {
    "": None,
    "~": None,
    "null": None,
    "Null": None,
    "NULL": None,
    "true": True,
    "True": True,
    "TRUE": True,
    "false": False,
    "False": False,
    "FALSE": False,
}


@dataclass(slots=True)
class Tree:
    """Plain data, the line of each part, and faults."""

    data: object = None
    """None, bool, int, float, str, and lists and mappings of these."""
    lines: dict[Location, int] = field(default_factory=dict)
    """Line of each field, counted from 1."""
    faults: list[Finding] = field(default_factory=list)
    """Faults that left the rest readable."""


def read_tree(text: str, file: str = "") -> Tree:
    """Read one YAML document; `file` is its name in messages.

    Raises:
        MissionError: the text is no YAML, or unreadable as a whole.
    """
    try:
        return _Reader(text, file).read()
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = mark.line + 1 if mark else 1
        detail = error.problem or error.context or "unreadable"
        raise _syntax_error(file, line, detail) from error
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        message = f"character U+{ord(text[error.position]):04X} cannot stand in a YAML file"
        raise MissionError((Finding("error", (), message, "remove it", file, line),)) from error
    except (ValueError, OverflowError) as error:
        # PyYAML lets these escape on absurd version numbers and on escapes past U+10FFFF
        raise _syntax_error(file, 1, "a number or escape is out of range") from error


def _syntax_error(file: str, line: int, detail: str) -> MissionError:
    remedy = "check indentation, colons, brackets and quotes there"
    message = f"not valid YAML: {shortened(detail, 100)}"
    return MissionError((Finding("error", (), message, remedy, file, line),))


class _Reader:
    """Builds the tree from PyYAML's stream of events."""

    def __init__(self, text: str, file: str) -> None:
        self._file = file
        self._tree = Tree()
        self._nodes = 0
        events = yaml.parse(text, Loader=yaml.SafeLoader)
        self._events: Iterator[yaml.Event] = self._bounded(self._written_out(events))

    def read(self) -> Tree:
        for event in self._events:
            if isinstance(event, yaml.DocumentStartEvent):
                self._tree.data = self._value(next(self._events), ())
                break
        for event in self._events:
            if isinstance(event, yaml.DocumentStartEvent):
                message, remedy = "a second document begins", "one file holds one mission"
                raise MissionError((self._fault(event, (), message, remedy),))
        return self._tree

    def _bounded(self, events: Iterator[yaml.Event]) -> Iterator[yaml.Event]:
        """Yield the events within the limits of number and depth."""
        depth = 0
        for event in events:
            self._nodes += isinstance(event, yaml.NodeEvent)
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            if self._nodes > MAX_NODES:
                message, remedy = f"more than {MAX_NODES} entries", "this is no mission file"
            elif depth > MAX_DEPTH:
                message, remedy = "nested too deeply", "no field lies that deep"
            else:
                yield event
                continue
            raise MissionError((self._fault(event, (), message, remedy),))

    def _fault(self, event: yaml.Event, location: Location, message: str, remedy: str) -> Finding:
        return Finding("error", location, message, remedy, self._file, _line(event))

    def _written_out(self, events: Iterable[yaml.Event]) -> Iterator[yaml.Event]:
        """Yield the events with each alias replaced by its anchor's events.

        Raises:
            MissionError: an alias has no anchor, or is part of its own anchor.
        """
        held: dict[str, list[yaml.Event]] = {}
        open_anchors: list[tuple[str | None, list[yaml.Event]]] = []
        for event in events:
            if isinstance(event, yaml.AliasEvent):
                if event.anchor not in held:
                    message = f"alias *{shortened(str(event.anchor))} has no anchor before it"
                    remedy = (
                        f"put &{shortened(str(event.anchor))} before the value that it stands for"
                    )
                    raise MissionError((self._fault(event, (), message, remedy),))
                content = held[event.anchor]
            else:
                content = [event]
            for one in content:
                for _, inside in open_anchors:
                    inside.append(one)
                yield one
            if isinstance(event, yaml.CollectionStartEvent):
                open_anchors.append((event.anchor, [event]))
            elif isinstance(event, yaml.CollectionEndEvent):
                anchor, inside = open_anchors.pop()
                if anchor is not None:
                    held[anchor] = inside
            elif isinstance(event, yaml.ScalarEvent) and event.anchor is not None:
                held[event.anchor] = [event]

    def _value(self, event: yaml.Event, location: Location) -> object:
        self._tree.lines.setdefault(location, _line(event))
        if isinstance(event, yaml.MappingStartEvent):
            self._refuse_tag(event, location, "tag:yaml.org,2002:map")
            return self._mapping(location)
        if isinstance(event, yaml.SequenceStartEvent):
            self._refuse_tag(event, location, "tag:yaml.org,2002:seq")
            return self._sequence(location)
        if isinstance(event, yaml.ScalarEvent):
            return self._scalar(event, location)
        raise MissionError((self._fault(event, location, "a value is missing here", ""),))

    def _mapping(self, location: Location) -> dict[str, object]:
        found: dict[str, object] = {}
        merged: list[tuple[dict[str, object], dict[Location, int]]] = []
        while not isinstance(event := next(self._events), yaml.MappingEndEvent):
            if not isinstance(event, yaml.ScalarEvent):
                message = "a list or group cannot be the name of a field"
                raise MissionError((self._fault(event, location, message, "write name: value"),))
            name = self._text(event, location)
            inner = (*location, name)
            if name == MERGE and event.style is None:
                merged += self._merged(next(self._events), location)
                continue
            if name in found:
                first = self._tree.lines[inner]
                message = f"given twice, first in line {first}"
                self._tree.faults.append(self._fault(event, inner, message, "remove one"))
                self._value(next(self._events), inner)
                continue
            self._tree.lines[inner] = _line(event)
            found[name] = self._value(next(self._events), inner)
        own = {*found}
        # Of several merged groups, the first that has a field provides it.
        for fields, lines in merged:
            new = {*fields} - {*found}
            found |= {name: fields[name] for name in fields if name in new}
            place = len(location)
            for inner, line in lines.items():
                if len(inner) > place and inner[place] in new and inner[place] not in own:
                    self._tree.lines[inner] = line
        return found

    def _merged(
        self, event: yaml.Event, location: Location
    ) -> Iterator[tuple[dict[str, object], dict[Location, int]]]:
        """Yield the groups to merge, each with the lines of its fields."""
        if isinstance(event, yaml.SequenceStartEvent):
            while not isinstance(one := next(self._events), yaml.SequenceEndEvent):
                yield from self._merged(one, location)
            return
        outer, self._tree.lines = self._tree.lines, {}
        fields = self._value(event, location)
        inner, self._tree.lines = self._tree.lines, outer
        if isinstance(fields, dict):
            yield fields, inner
        else:
            message, remedy = "<<: takes a group of fields", "write <<: *name of an anchor"
            self._tree.faults.append(self._fault(event, location, message, remedy))

    def _sequence(self, location: Location) -> list[object]:
        found: list[object] = []
        while not isinstance(event := next(self._events), yaml.SequenceEndEvent):
            found.append(self._value(event, (*location, len(found))))
        return found

    def _scalar(self, event: yaml.ScalarEvent, location: Location) -> object:
        self._refuse_tag(event, location, "tag:yaml.org,2002:str")
        if event.style is None and event.tag is None:
            return plain_value(self._text(event, location))
        return self._text(event, location)

    def _text(self, event: yaml.ScalarEvent, location: Location) -> str:
        """Return the text of a scalar; lone surrogates are a fault, since no output could carry them."""
        if any("\ud800" <= character <= "\udfff" for character in event.value):
            message, remedy = "half of a surrogate pair is no character", "remove it"
            self._tree.faults.append(self._fault(event, location, message, remedy))
            return event.value.encode("utf-8", "replace").decode()
        return str(event.value)

    def _refuse_tag(self, event: yaml.Event, location: Location, own: str) -> None:
        """Record a foreign tag as a fault: tags can make YAML construct anything."""
        tag = getattr(event, "tag", None)
        if tag is not None and tag not in {own, "!"}:
            short = str(tag).replace("tag:yaml.org,2002:", "!!")
            message = f"tag {shortened(short)} is not supported"
            fault = self._fault(event, location, message, "write the plain value")
            self._tree.faults.append(fault)


def _line(event: yaml.Event) -> int:
    return event.start_mark.line + 1 if event.start_mark else 1


def plain_value(text: str) -> object:
    """Return the value of an unquoted scalar by the core schema of YAML 1.2."""
    if text in _WORDS:
        return _WORDS[text]
    if _INTEGER.fullmatch(text) and len(text) <= MAX_DIGITS:
        return int(text)
    if _HEXADECIMAL.fullmatch(text) and len(text) <= MAX_DIGITS:
        return int(text, 16)
    if _FLOAT.fullmatch(text) or _INTEGER.fullmatch(text):
        return float(text)
    if _NOT_FINITE.fullmatch(text):
        return float(text.replace(".", "", 1))
    return text
