"""Programs that are not Python's: a machine without them may do without these tests, CI may not."""

import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.kit.programs import Mosquitto, brokers


def program(name: str, package: str) -> str:
    """Path of a program; without it the test is skipped, or fails where CI runs."""
    found = shutil.which(name, path=f"{os.environ.get('PATH', '')}:/usr/sbin:/sbin")
    if found is None:
        missing = f"{name} is not installed; apt install {package}"
        if os.environ.get("CI"):
            pytest.fail(missing)
        pytest.skip(missing)
    return found


@pytest.fixture(scope="session")
def mosquitto_program() -> str:
    return program("mosquitto", "mosquitto")


@pytest.fixture(scope="session")
def openssl_program() -> str:
    return program("openssl", "openssl")


@pytest.fixture
def mosquitto(tmp_path: Path, mosquitto_program: str) -> Iterator[Callable[..., Mosquitto]]:
    """Starts brokers, with lines of configuration to add."""
    with brokers(mosquitto_program, tmp_path) as make:
        yield make
