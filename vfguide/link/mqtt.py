"""What a formation shares, by way of an MQTT broker.

States are sent once and not kept: a state that the broker repeats to those who come later has no age. Nothing
waits in a queue in either direction, since the next state is better than an old one.
"""

from collections.abc import Mapping
from random import Random
from urllib.parse import SplitResult

from vfguide.link.address import MqttAddress, mqtt_address
from vfguide.link.carrier import Carrier, link
from vfguide.link.client import Echo, NewestOnly, security_of
from vfguide.link.envelope import Kind
from vfguide.link.member import Member, Parcel
from vfguide.link.presence import Presence
from vfguide.link.session import Parts, Reconnecting, Topics


@link("mqtt")
@link("mqtts")
class MqttCarrier(Carrier):
    """Carries messages by way of one broker, to which it connects again whenever the connection is lost."""

    def __init__(
        self,
        address: MqttAddress,
        *,
        formation: str,
        member: Member,
        presence: Presence,
        random: Random,
    ) -> None:
        """Make one that is not connected yet; arguments as of `Carrier`.

        Raises:
            InputError: the address names a certificate that cannot be read.
        """
        super().__init__(
            address, formation=formation, member=member, presence=presence, random=random
        )
        counters = self.status.counters
        self._parts = Parts(
            topics=Topics(prefix=address.prefix, formation=formation, vehicle=member.name),
            member=member,
            status=self.status,
            outbox=NewestOnly(lambda: counters.update(["replaced before it was sent"])),
            echo=Echo(),
            presence=presence,
        )
        self._reconnecting = Reconnecting(address, security_of(address), self._parts, random)

    @classmethod
    def address_of(cls, parts: SplitResult, environment: Mapping[str, str]) -> MqttAddress:
        """A broker."""
        return mqtt_address(parts, environment)

    async def run(self) -> None:
        """Carry until told to stop."""
        await self._reconnecting.run()

    def stop(self) -> None:
        """Say goodbye; `run` ends soon after."""
        self._reconnecting.stop()

    def send(self, parcel: Parcel) -> None:
        """Send a message once. Never waits: one of its topic that is not sent yet gives way to it."""
        parts = self._parts
        if parcel.kind is Kind.STATE:
            parts.echo.speak(parcel.data)
        if parts.status.connected:
            parts.outbox.put(parts.topic_of(parcel), parcel.data)
        elif parcel.kind is Kind.STATE:
            parts.status.counters["dropped: not connected"] += 1

    def announce(self, presence: Presence) -> None:
        """Have the broker keep a presence for those who come later."""
        self._parts.presence = presence
        self._parts.announced.set()
