"""The emulator by itself: its own wheel, in a Python that has no vfguide."""

import shutil
import subprocess
import sysconfig
import tomllib
from pathlib import Path
from typing import Any

from tests.kit.missions import ROOT
from tests.wheels import packages_of, python_with

EMULATOR = ROOT / "sitl_stub"

FLIGHT = """
import importlib.util, math
assert importlib.util.find_spec("vfguide") is None
from sitl_stub import Autopilot, Settings
settings = Settings(system_id=1, airborne=True)
flown = Autopilot(settings.config(), settings.air())
start = flown.truth()
flown.advance(1.0)
end = flown.truth()
metre = math.degrees(1.0 / 6_371_000.0)
north = (end.latitude_deg - start.latitude_deg) / metre
east = (end.longitude_deg - start.longitude_deg) / metre * math.cos(math.radians(end.latitude_deg))
print(abs(math.hypot(north, east) / start.ground_speed_m_s - 1.0) < 0.02)
"""
"""In a second it flies as far as its speed says; the earth's shape takes a percent."""


def project_of(file: Path) -> dict[str, Any]:
    """The `[project]` table of a pyproject.toml."""
    table: dict[str, Any] = tomllib.loads(file.read_text())["project"]
    return table


def test_it_asks_for_what_the_project_asks_for_and_has_its_version():
    whole = project_of(ROOT / "pyproject.toml")
    alone = project_of(EMULATOR / "pyproject.toml")
    assert alone["version"] == whole["version"]
    assert set(alone["dependencies"]) < set(whole["dependencies"])


def test_its_wheel_flies_where_vfguide_is_not_installed(tmp_path):
    # A copy: a build leaves nothing in the checkout.
    sources = tmp_path / "sitl_stub"
    shutil.copytree(EMULATOR, sources, ignore=shutil.ignore_patterns("__pycache__"))
    python = python_with(sources, tmp_path)
    # The libraries of this environment, but not vfguide, whose editable install a .pth file would bring.
    packages = packages_of(python)
    for one in Path(sysconfig.get_path("purelib")).iterdir():
        if "vfguide" not in one.name and not one.name.endswith(".pth"):
            target = packages / one.name
            if not target.exists():
                target.symlink_to(one)
    command = (python.with_name("sitl-stub"), "--version")
    told = subprocess.run(command, check=True, capture_output=True, text=True, cwd=tmp_path)
    assert told.stdout == f"sitl-stub {project_of(EMULATOR / 'pyproject.toml')['version']}\n"
    flown = subprocess.run(
        [python, "-I", "-c", FLIGHT], check=False, capture_output=True, text=True, cwd=tmp_path
    )
    assert (flown.returncode, flown.stdout, flown.stderr) == (0, "True\n", "")
