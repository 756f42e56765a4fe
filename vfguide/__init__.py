"""Companion-computer guidance that flies fixed-wing UAVs as one formation.

```python
import vfguide
mission = vfguide.load_mission("missions/circle-wind.yaml")
flight = vfguide.fly(mission, law="slot", duration_s=60)
flight.summary.formation.mean_error_m, flight.tracks["f1"].north_m
```
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vfguide.flights import Comparison, Flight, compare, environment, fly, load_mission, order

__all__ = ["Comparison", "Flight", "compare", "environment", "fly", "load_mission", "order"]


def __getattr__(name: str) -> Any:  # noqa: ANN401 - of whatever is public
    """Return a public name, imported on first use: a companion in the air needs none of them."""
    if name not in __all__:
        raise AttributeError(f"module 'vfguide' has no attribute {name!r}")
    from vfguide import flights

    return getattr(flights, name)


def __dir__() -> list[str]:
    """Return the public names."""
    return [*__all__]
