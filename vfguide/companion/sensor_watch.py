"""What the own vehicle's autopilot says of its sensors and batteries."""

from dataclasses import replace

from vfguide.mavlink.reports import BatteryReport, SensorsReport

SENSORS_S = 10.0
"""After so long the word of the sensors and the battery counts as old."""

MOST_BATTERIES = 10
"""Of a vehicle, that are kept apart."""


class SensorWatch:
    """The newest word of one vehicle's sensors and of each of its batteries."""

    def __init__(self) -> None:
        self._batteries: dict[int, tuple[BatteryReport, float]] = {}
        self._said: tuple[SensorsReport, float] | None = None

    def note(self, report: SensorsReport, now: float) -> None:
        """Take what the autopilot says of its sensors."""
        self._said = report, now

    def note_battery(self, report: BatteryReport, now: float) -> None:
        """Take what it says of one battery."""
        self._batteries = {
            number: (one, when)
            for number, (one, when) in self._batteries.items()
            if now - when <= SENSORS_S
        }
        if len(self._batteries) < MOST_BATTERIES or report.number in self._batteries:
            self._batteries[report.number] = report, now

    def newest(self, now: float) -> SensorsReport | None:
        """What was said last, with the battery of which least is left; None if that is long ago."""
        if self._said is None or now - self._said[1] > SENSORS_S:
            return None
        said = self._said[0]
        # Of two that have as much left the first counts: volts belong to what is left of the same battery.
        known = [(said.battery, said.battery_voltage)]
        known += [
            (one.remaining, one.voltage)
            for one, when in self._batteries.values()
            if now - when <= SENSORS_S
        ]
        counted = [(left, voltage) for left, voltage in known if left is not None]
        if not counted:
            return said
        left, voltage = min(counted, key=lambda one: one[0])
        return replace(said, battery=left, battery_voltage=voltage)
