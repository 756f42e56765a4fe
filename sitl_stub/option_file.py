"""Options of the command in a file: what a fleet is started with again and again."""

import difflib
from collections.abc import Collection
from pathlib import Path

import yaml

MOST_BYTES = 65_536
"""A file of options is smaller than this."""


class OptionFileError(ValueError):
    """What is wrong with a file of options, in one line with the remedy."""


def read_options(file: Path, known: Collection[str]) -> dict[str, object]:
    """The options in a file of YAML, by their names in the program.

    A line of the file is an option without its dashes, such as `airspeed-range: "16,32"`; an option that may
    be repeated has a list.

    Args:
        file: to read.
        known: names in the program of all options.

    Raises:
        OptionFileError: it cannot be read, holds no options, or one that is not known.
    """
    try:
        with file.open("rb") as stream:
            content = stream.read(MOST_BYTES + 1)
    except OSError as error:
        raise OptionFileError(f"{file}: {error.strerror}; name a file of options") from error
    if len(content) > MOST_BYTES:
        raise OptionFileError(f"{file}: larger than 64 KiB; this is no file of options")
    try:
        read = yaml.safe_load(content)
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError, ValueError) as error:
        raise OptionFileError(f"{file}: this is no YAML; write lines such as alpha: 0.9") from error
    if not isinstance(read, dict):
        raise OptionFileError(f"{file}: holds no options; write lines such as alpha: 0.9")
    options: dict[str, object] = {}
    for key, value in read.items():
        name = str(key).replace("-", "_")
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1)
            hint = f"did you mean {near[0].replace('_', '-')}?" if near else "see sitl-stub --help"
            raise OptionFileError(f"{file}: there is no option {key!r}; {hint}")
        if isinstance(value, dict) or (
            isinstance(value, list) and any(isinstance(one, dict | list) for one in value)
        ):
            raise OptionFileError(f"{file}: {key}: write one value, or a list of them")
        options[name] = value
    return options
