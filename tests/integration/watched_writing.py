"""Put before a program as `sitecustomize`: writes down every file that it opens to write, makes or removes.

What compiled libraries do by themselves Python is not told of; the test looks at the directories, too.
"""

import os
import sys
from pathlib import Path

WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
PLACES = {
    "os.mkdir": 1,
    "os.remove": 1,
    "os.rmdir": 1,
    "os.truncate": 1,
    "os.chmod": 1,
    "os.utime": 1,
    "os.rename": 2,
    "os.link": 2,
    "os.symlink": 2,
    "shutil.rmtree": 1,
    "sqlite3.connect": 1,
}
"""Events and how many of their arguments, from the first, are places."""

log = os.open(os.environ["WRITES_ARE_TOLD_TO"], os.O_WRONLY | os.O_APPEND | os.O_CREAT)


def tell(event: str, arguments: tuple[object, ...]) -> None:
    """One line for each place that is written to."""
    if event == "open" and len(arguments) == 3 and isinstance(arguments[2], int):
        places = arguments[:1] if arguments[2] & WRITES else ()
    elif event in {"os.remove", "os.rmdir"} and arguments[1] != -1:
        # Within a directory that is open: of `shutil.rmtree`, which has told of it.
        places = ()
    else:
        places = arguments[: PLACES.get(event, 0)]
    for place in places:
        # Numbers are files that are open already.
        if isinstance(place, str | bytes | os.PathLike):
            whole = Path.cwd() / os.fsdecode(place)
            os.write(log, f"{event} {whole}\n".encode("utf-8", "backslashreplace"))


sys.addaudithook(tell)
tell("os.mkdir", (os.devnull,))
