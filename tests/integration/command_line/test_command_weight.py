"""What a daemon on an aircraft does not have to carry."""

import subprocess
import sys

import pytest

MOST_MB = 68
"""Resident memory of a process that has imported the daemon: 62 to 64 MB; shares: docs/benchmarks.md."""


def printed_by(program: str) -> str:
    """What a program of Python prints, in a process of its own."""
    return subprocess.check_output([sys.executable, "-c", program], text=True)


@pytest.mark.parametrize(
    ("modules", "libraries"),
    [
        # The command line carries nothing that a companion has no use for.
        (
            "vfguide.cli, vfguide.commands.companion",
            {"matplotlib", "mavsdk", "sitl_stub", "dask", "osqp"},
        ),
        # The daemon loads what keys and links need only when it is given them.
        ("vfguide.companion.daemon", {"cryptography", "aiomqtt", "zenoh", "scipy", "typer"}),
    ],
)
def test_an_aircraft_loads_no_library_that_it_has_no_use_for(modules, libraries):
    program = f"import sys, {modules}; print(sorted({libraries!r} & sys.modules.keys()))"
    assert printed_by(program) == "[]\n"


def test_the_daemon_takes_little_memory():
    program = (
        "import vfguide.companion.daemon; print(open('/proc/self/status', encoding='utf-8').read())"
    )
    (line,) = (one for one in printed_by(program).splitlines() if one.startswith("VmRSS:"))
    assert int(line.split()[1]) / 1024 < MOST_MB
