"""A codec that listens to the emulated autopilot of the kit."""

import pytest

from vfguide.mavlink.codec import Codec


@pytest.fixture
def codec() -> Codec:
    """Listens to system 7, component 1."""
    return Codec(7, 1)
