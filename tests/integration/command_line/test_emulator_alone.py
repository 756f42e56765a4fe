"""The emulator by itself: its own wheel, in a Python that has no vfguide."""

import shutil
import subprocess
import sysconfig
import tomllib
from pathlib import Path

import sitl_stub
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


def test_it_asks_for_what_the_project_asks_for_and_has_its_version():
    whole, alone = (
        tomllib.loads((place / "pyproject.toml").read_text()) for place in (ROOT, EMULATOR)
    )
    sources = [
        (place / one["tool"]["hatch"]["version"]["path"]).resolve()
        for place, one in ((ROOT, whole), (EMULATOR, alone))
    ]
    assert sources[0] == sources[1]
    assert set(alone["project"]["dependencies"]) < set(whole["project"]["dependencies"])


def test_its_wheel_flies_where_vfguide_is_not_installed(tmp_path):
    # A copy: a build leaves nothing in the checkout.
    sources = tmp_path / "sitl_stub"
    shutil.copytree(EMULATOR, sources, ignore=shutil.ignore_patterns("__pycache__"))
    python = python_with(sources, tmp_path)
    # The libraries of this environment, but not vfguide, whose editable install a .pth file would bring.
    packages = packages_of(python)
    for one in Path(sysconfig.get_path("purelib")).iterdir():
        if not one.name.startswith(("vfguide", "sitl_stub")) and one.suffix != ".pth":
            target = packages / one.name
            if not target.exists():
                target.symlink_to(one)
    command = (python.with_name("sitl-stub"), "--version")
    told = subprocess.run(command, check=True, capture_output=True, text=True, cwd=tmp_path)
    assert told.stdout == f"sitl-stub {sitl_stub.__version__}\n"
    flown = subprocess.run(
        [python, "-I", "-c", FLIGHT], check=False, capture_output=True, text=True, cwd=tmp_path
    )
    assert (flown.returncode, flown.stdout, flown.stderr) == (0, "True\n", "")
