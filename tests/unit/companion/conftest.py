"""What several tests of companions begin with."""

import pytest

from vfguide.companion.alerts import Alerts


@pytest.fixture
def alerts() -> Alerts:
    return Alerts()
