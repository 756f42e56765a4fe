"""Names of the topics that a formation shares."""

import re
from dataclasses import dataclass
from urllib.parse import quote

LEVEL = re.compile(r"[^/+#\x00-\x1f\x7f]{1,200}")
"""What a vehicle's level of a topic may look like when it comes from somebody else."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Topics:
    """Of one vehicle in one formation."""

    prefix: str
    """First levels of every topic."""
    formation: str
    """Name of the formation."""
    vehicle: str
    """Name of the vehicle."""

    def state(self, vehicle: str) -> str:
        """Where a vehicle's states are."""
        return f"{self._of(vehicle)}/state"

    def presence(self, vehicle: str) -> str:
        """Where a vehicle says whether it is there."""
        return f"{self._of(vehicle)}/presence"

    def ask(self, leader: str) -> str:
        """Where this vehicle asks a leader what its clock shows."""
        return f"{self._of(leader)}/clock/ask/{level(self.vehicle)}"

    def tell(self, leader: str) -> str:
        """Where a leader answers to this vehicle."""
        return f"{self._of(leader)}/clock/tell/{level(self.vehicle)}"

    def every_ask(self) -> str:
        """Filter for all that others ask of this vehicle's clock."""
        return f"{self._of(self.vehicle)}/clock/ask/+"

    def answer_to(self, topic: str) -> str | None:
        """Where to answer what came on this topic; None if nobody asks for the time there."""
        before, _, asker = topic.rpartition("/")
        own = self._of(self.vehicle)
        if before != f"{own}/clock/ask" or not LEVEL.fullmatch(asker):
            return None
        return f"{own}/clock/tell/{asker}"

    def _of(self, vehicle: str) -> str:
        return f"{self.prefix}/{level(self.formation)}/{level(vehicle)}"


def level(name: str) -> str:
    """A name as one level of a topic: its slashes and wildcards would be read as something else."""
    return quote(name, safe=" !'()*,:;=@&")
