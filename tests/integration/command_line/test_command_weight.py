"""What a daemon on an aircraft does not have to carry."""

import subprocess
import sys

import pytest

MOST_MB = 68
"""Resident memory of a process that has imported the daemon: 62 to 64 MB; shares: docs/benchmarks.md."""


def printed_by(program: str) -> str:
    """What a program of Python prints, in a process of its own."""
    return subprocess.check_output([sys.executable, "-c", program], text=True)


@pytest.mark.parametrize("library", ["matplotlib", "mavsdk", "sitl_stub", "dask", "osqp"])
def test_the_command_line_loads_no_library_that_a_companion_has_no_use_for(library):
    modules = "sys, vfguide.cli, vfguide.commands.companion"
    assert printed_by(f"import {modules}; print({library!r} in sys.modules)") == "False\n"


@pytest.mark.parametrize("library", ["cryptography", "aiomqtt", "zenoh", "scipy", "typer"])
def test_the_daemon_loads_what_keys_and_links_need_only_when_it_is_given_them(library):
    modules = "sys, vfguide.companion.daemon"
    assert printed_by(f"import {modules}; print({library!r} in sys.modules)") == "False\n"


def test_the_daemon_takes_little_memory():
    program = (
        "import vfguide.companion.daemon; print(open('/proc/self/status', encoding='utf-8').read())"
    )
    (line,) = (one for one in printed_by(program).splitlines() if one.startswith("VmRSS:"))
    assert int(line.split()[1]) / 1024 < MOST_MB
