"""Where a command runs that is watched: nothing in it but what the test has put there."""

import os
import re
import shutil
import signal
import subprocess
import sys
import urllib.request
from dataclasses import dataclass
from pathlib import Path

from vfguide.cli import MATPLOTLIB
from vfguide.commands.output import PARTIAL

PATIENCE_S = 240.0
"""For a process that hangs; no test waits for it."""

NO_FILES = ("/dev/null", "/dev/urandom", "/dev/tty", "/proc/self/")


@dataclass(frozen=True, slots=True)
class Surroundings:
    """Where a command runs: nothing in it but what the test has put there."""

    root: Path

    @property
    def out(self) -> Path:
        """The one place that is named with --out."""
        return self.root / "out"

    def start(self, *words: str | Path) -> subprocess.Popen[str]:
        """A command, watched."""
        for name in ("home", "temporary", "here", "watch"):
            (self.root / name).mkdir(exist_ok=True)
        shutil.copy(
            Path(__file__).with_name("watched_writing.py"), self.root / "watch" / "sitecustomize.py"
        )
        places = [str(self.root / "watch"), *filter(None, [os.environ.get("PYTHONPATH")])]
        # A command that ran in the tests' own process has named a place for Matplotlib there.
        own = ("XDG_", MATPLOTLIB)
        environment = {
            **{name: value for name, value in os.environ.items() if not name.startswith(own)},
            "HOME": str(self.root / "home"),
            "TMPDIR": str(self.root / "temporary"),
            "PYTHONPATH": os.pathsep.join(places),
            "PYTHONDONTWRITEBYTECODE": "1",
            "WRITES_ARE_TOLD_TO": str(self.root / "told"),
        }
        return subprocess.Popen(
            [sys.executable, "-m", "vfguide", *map(str, words)],
            cwd=self.root / "here",
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def run(self, *words: str | Path) -> str:
        """What a command says that ends well by itself."""
        process = self.start(*words)
        said, errors = process.communicate(timeout=PATIENCE_S)
        assert process.returncode == 0, errors
        return said

    def see_a_console_and_stop_it(self, process: subprocess.Popen[str]) -> None:
        """Open the page of a console as a browser does, and end it as Ctrl-C does."""
        assert process.stdout is not None
        address = re.search(r"http://\S+", process.stdout.readline())
        assert address is not None
        # The address has the token for the cookie that lets in.
        browser = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
        with browser.open(address.group(), timeout=PATIENCE_S) as page:
            assert b"<html" in page.read()
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=PATIENCE_S)
        assert process.returncode == 0

    def see_that_nothing_else_was_written(self) -> None:
        """Only `out`; what was put aside meanwhile is gone."""
        told = (self.root / "told").read_text(encoding="utf-8").splitlines()
        assert told
        # Files are made whole in a directory beside them.
        partial = str(self.root / PARTIAL)
        good = (str(self.out), partial, str(self.root / "temporary"), *NO_FILES)
        elsewhere = [line for line in told if not line.partition(" ")[2].startswith(good)]
        assert not elsewhere, elsewhere
        for name in ("home", "temporary", "here"):
            assert list((self.root / name).iterdir()) == [], name
        assert list(self.root.glob(f"{PARTIAL}*")) == []
