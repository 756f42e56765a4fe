"""A Python of its own that has one distribution from its wheel, as a user installs it."""

import subprocess
import sys
import venv
from pathlib import Path

PIP = (sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet")


def python_with(sources: Path, place: Path) -> Path:
    """Build the wheel of these sources, install it alone into a new environment, and return its Python.

    Args:
        sources: directory with a pyproject.toml.
        place: empty directory for wheel and environment.
    """
    build = ("wheel", "--no-deps", "--no-build-isolation", "--wheel-dir", place, sources)
    subprocess.run([*PIP, *build], check=True)
    (wheel,) = place.glob("*.whl")
    venv.create(place / "venv", symlinks=True)
    python = place / "venv" / "bin" / "python"
    subprocess.run(
        [*PIP[:3], "--python", python, *PIP[3:], "install", "--no-deps", wheel], check=True
    )
    return python


def packages_of(python: Path) -> Path:
    """Where such an environment keeps its packages."""
    (packages,) = python.parents[1].glob("lib/python*/site-packages")
    return packages
