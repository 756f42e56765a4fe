"""What a daemon on an aircraft does not have to carry."""

import subprocess
import sys

import pytest


@pytest.mark.parametrize("library", ["matplotlib", "amqtt", "mavsdk", "sitl_stub", "dask", "osqp"])
def test_the_command_line_loads_no_library_that_a_companion_has_no_use_for(library: str) -> None:
    modules = "sys, vfguide.cli, vfguide.commands.companion"
    program = f"import {modules}; sys.exit({library!r} in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0
