"""Names of the topics that a formation shares."""

from dataclasses import dataclass
from urllib.parse import quote

from vfguide.link.envelope import Kind

ORDERING = {Kind.ORDER: "order", Kind.REPEAT: "repeat", Kind.REPLY: "reply"}
"""Last level of the topics of orders."""


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

    def lead(self, vehicle: str) -> str:
        """Where the states are by which a vehicle leads in the place of the mission's leader."""
        return f"{self._of(vehicle)}/lead"

    def presence(self, vehicle: str) -> str:
        """Where a vehicle says whether it is there."""
        return f"{self._of(vehicle)}/presence"

    def every_presence(self) -> str:
        """Filter for what all vehicles say about themselves."""
        return f"{self.prefix}/{level(self.formation)}/+/presence"

    def ask(self, leader: str) -> str:
        """Where this vehicle asks a leader what its clock shows."""
        return f"{self._of(leader)}/clock/ask/{level(self.vehicle)}"

    def every_ask(self, leader: str) -> str:
        """Filter for all that others ask of a leader's clock."""
        return f"{self._of(leader)}/clock/ask/+"

    def answer_of(self, leader: str) -> str:
        """Where a leader answers to this vehicle."""
        return f"{self._of(leader)}/clock/tell/{level(self.vehicle)}"

    def answer(self, asker: str) -> str:
        """Where this vehicle answers to another."""
        return f"{self._of(self.vehicle)}/clock/tell/{level(asker)}"

    def about_orders(self, kind: Kind) -> str:
        """Where this member gives orders, repeats them, or says what becomes of them."""
        return f"{self._of(self.vehicle)}/{ORDERING[kind]}"

    def every_order(self) -> tuple[str, ...]:
        """Filters for all of that, of everybody."""
        every = f"{self.prefix}/{level(self.formation)}/+"
        return tuple(f"{every}/{name}" for name in ORDERING.values())

    def _of(self, vehicle: str) -> str:
        return f"{self.prefix}/{level(self.formation)}/{level(vehicle)}"


def level(name: str) -> str:
    """A name as one level of a topic: its slashes and wildcards would be read as something else."""
    return quote(name, safe=" !'()*,:;=@&")
