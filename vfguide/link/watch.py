"""Listening to the presences of a formation, for people who want to know how it is."""

import asyncio
from random import Random

from aiomqtt import MqttError, Will

from vfguide.errors import VfguideError
from vfguide.link.address import LinkAddress
from vfguide.link.client import BrokerClient, reason_of, security_of
from vfguide.link.codec import LinkDataError
from vfguide.link.presence import Presence, decode_presence
from vfguide.link.topics import level


async def presences(
    address: LinkAddress, formation: str, *, seconds: float, random: Random
) -> dict[str, Presence]:
    """What each vehicle of a formation last said about itself, by name.

    Presences are kept by the broker, so that even a short look finds everybody.

    Args:
        address: of the broker.
        formation: name of the formation.
        seconds: how long to listen.
        random: for a name of one's own at the broker.

    Raises:
        VfguideError: the broker does not answer, or refuses.
    """
    found: dict[str, Presence] = {}
    own = f"{address.prefix}/{level(formation)}"
    client = BrokerClient(
        address,
        identifier=f"vfguide-status-{random.getrandbits(32):08x}",
        will=Will(f"{own}/-/watch"),
        queue=asyncio.Queue,
        context=security_of(address),
    )
    try:
        await client.open()
    except MqttError as error:
        raise VfguideError(f"link {address}: {reason_of(error)}") from error
    try:
        await client.subscribe(f"{own}/+/presence")
        async with asyncio.timeout(seconds):
            async for message in client.messages:
                vehicle = message.topic.value.split("/")[-2]
                if isinstance(message.payload, bytes):
                    note(found, vehicle, message.payload)
    except TimeoutError:
        return found
    except MqttError as error:
        raise VfguideError(f"link {address}: {reason_of(error)}") from error
    finally:
        await client.close()
    return found


def note(found: dict[str, Presence], vehicle: str, data: bytes) -> None:
    """Keep a presence, unless it is none."""
    try:
        found[vehicle] = decode_presence(data)
    except LinkDataError:
        return
