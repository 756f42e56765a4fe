"""Gives an order as `vfguide order` does, in a program of its own: a rehearsal would delay setpoints."""

import asyncio
import os
import sys
from asyncio.subprocess import DEVNULL, PIPE, STDOUT
from collections.abc import Callable
from pathlib import Path

import msgspec

from vfguide.companion.ground_orders import ABORT

LONGEST_S = 180.0
"""A program that takes longer is ended: what it was to order is not of now any more."""

MOST_LINES = 24
"""So many lines of it are told: more than it has to say of eight aircraft."""

CHUNK = 1024
"""Bytes that are read at once, and of a line that are told at most."""

NICE = 10
"""A rehearsal gives way to the companion, which has to answer every position at once. An abort has none."""


class OrderProgram(msgspec.Struct, frozen=True, kw_only=True):
    """How `vfguide order` is called for one formation."""

    mission: Path
    """The mission's file."""
    links: tuple[str, ...]
    """Addresses of the formation's links."""
    key: Path | None
    """The operator's private key; None to sign nothing."""
    roster: Path | None = None
    """Everybody's public keys, where they are not beside the mission."""

    def arguments(self, words: tuple[str, ...]) -> list[str]:
        """The program and its arguments, for an order in words."""
        found = [sys.executable, "-m", "vfguide", "order", str(self.mission), *words]
        for link in self.links:
            found += ["--link", link]
        if self.key is None:
            return [*found, "--insecure"]
        found += ["--key", str(self.key)]
        return found if self.roster is None else [*found, "--roster", str(self.roster)]

    async def give(self, words: tuple[str, ...], tell: Callable[[str], None]) -> None:
        """Give an order, and tell line by line what becomes of it; whatever happens, it ends."""
        try:
            program = await asyncio.create_subprocess_exec(
                *self.arguments(words), stdin=DEVNULL, stdout=PIPE, stderr=STDOUT
            )
        except OSError as error:
            tell(f"the order cannot be given: {error.strerror}")
            return
        try:
            if words != ABORT:
                os.setpriority(os.PRIO_PROCESS, program.pid, NICE)
            async with asyncio.timeout(LONGEST_S):
                await tell_lines(program, tell)
                await program.wait()
        except (TimeoutError, ProcessLookupError):
            tell(f"the order took longer than {LONGEST_S:g} s, and is given up")
        finally:
            if program.returncode is None:
                program.kill()
                # It counts as ended once its pipe is read to its end.
                await program.communicate()


async def tell_lines(program: asyncio.subprocess.Process, tell: Callable[[str], None]) -> None:
    """Tell what a program says, until it has said all; what is too much is read and left out."""
    told, rest = 0, b""
    while program.stdout is not None and (data := await program.stdout.read(CHUNK)):
        *lines, rest = (rest + data).split(b"\n")
        rest = rest[:CHUNK]
        for line in lines:
            text = line[:CHUNK].decode("utf-8", "replace").strip()
            if text and told < MOST_LINES:
                told += 1
                tell(text)
