"""Whether a route is flown to its end, where everybody is handed back to the autopilot.

Each companion finds that out by itself, from the leader's place: nobody has to be told, and who hears nobody
at that moment carries the leader on along the route and finds the same. Where the end is counts as known
once the leader has flown a quarter of the circle there: a leg that touches or crosses that circle leaves it
long before, and so does a vehicle that gathers near it.
"""

import math

from vfguide.guidance.path import END_SHARE, Path, PathPoint

BESIDE_M = 30.0
"""A leader that is further away from the circle does not fly it."""


class RouteEnd:
    """What one companion has seen of the end of the leader's path."""

    def __init__(self) -> None:
        """Nothing was seen yet."""
        self._path: Path | None = None
        self._begin: float | None = None

    def passed(self, path: Path, point: PathPoint[float], *, steered: bool) -> bool:
        """Whether the leader has come to the end of its path.

        Args:
            path: that it follows.
            point: of the path, where it is nearest to the leader.
            steered: whether its companion steers it. Without that no flight of the circle begins: it may
                loiter there before the start. One that has begun goes on, as the leader may be handed back
                a moment before the others.
        """
        if path is not self._path:
            self._path, self._begin = path, None
        circle = path.last_circle
        if circle is None:
            return False
        run = point.progress - circle
        flown = run >= 0.0 and abs(point.cross_track_error) <= BESIDE_M
        # A place that is not known is no place on the circle.
        if not flown:
            self._begin = None
            return False
        if self._begin is None:
            self._begin = run if steered else None
        elif run < self._begin:
            self._begin = run
        if self._begin is None or not math.isfinite(run):
            return False
        return run - self._begin >= END_SHARE * (path.length - circle)
