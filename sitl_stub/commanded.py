"""What was commanded and what the loops know of it yet: commands may have a dead time."""

from collections import deque

from sitl_stub.aircraft import PlantParameters
from sitl_stub.targets import HeightTarget, SpeedTarget, Targets, TurnTarget


class Commanded:
    """The loops' targets now, and those on their way to the loops."""

    def __init__(self, plant: PlantParameters, targets: Targets) -> None:
        self.now = targets
        """What the loops hold."""
        self._turn_delay_us = round(plant.course_dead_time_s * 1e6)
        self._speed_delay_us = round(plant.speed_delay_s * 1e6)
        self._turns: deque[tuple[int, TurnTarget]] = deque()
        self._speeds: deque[tuple[int, SpeedTarget]] = deque()

    @property
    def next_us(self) -> int | None:
        """When the loops learn of something next; None if nothing is on its way."""
        first = [queue[0][0] for queue in (self._turns, self._speeds) if queue]
        return min(first, default=None)

    def set_all(self, targets: Targets) -> None:
        """Change everything at once, as a change of mode does; what was on its way is forgotten."""
        self.now = targets
        self._turns.clear()
        self._speeds.clear()

    def turn(self, target: TurnTarget, now_us: int) -> None:
        """A command to the lateral loop."""
        if self._turn_delay_us == 0:
            self.now = Targets(target, self.now.speed, self.now.height)
        else:
            self._turns.append((now_us + self._turn_delay_us, target))

    def speed(self, target: SpeedTarget, now_us: int) -> None:
        """A command to the speed loop."""
        if self._speed_delay_us == 0:
            self.now = Targets(self.now.turn, target, self.now.height)
        else:
            self._speeds.append((now_us + self._speed_delay_us, target))

    def height(self, target: HeightTarget) -> None:
        """A command to the height loop, which has no dead time."""
        self.now = Targets(self.now.turn, self.now.speed, target)

    def take_effect(self, time_us: int) -> None:
        """Let the loops know what has reached them by now."""
        while self._turns and self._turns[0][0] <= time_us:
            turn = self._turns.popleft()[1]
            self.now = Targets(turn, self.now.speed, self.now.height)
        while self._speeds and self._speeds[0][0] <= time_us:
            speed = self._speeds.popleft()[1]
            self.now = Targets(self.now.turn, speed, self.now.height)
