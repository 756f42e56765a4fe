"""Listening to the presences of a formation, for people who want to know how it is."""

import asyncio
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager, suppress
from random import Random

from aiomqtt import MqttError, Will

from vfguide.errors import VfguideError
from vfguide.link.address import LinkAddress
from vfguide.link.client import BrokerClient, reason_of, security_of
from vfguide.link.codec import LinkDataError
from vfguide.link.presence import Presence, decode_presence
from vfguide.link.topics import level

RETRY_S = 1.0
"""s from one try to reach a broker that is away to the next."""


@asynccontextmanager
async def watching(
    address: LinkAddress, formation: str, *, random: Random
) -> AsyncIterator[Mapping[str, Presence]]:
    """Presences by vehicle, kept current for as long as the context lasts; old ones while no broker answers.

    Args:
        address: of the broker.
        formation: name of the formation.
        random: for a name of one's own at the broker.
    """
    found: dict[str, Presence] = {}

    async def watch() -> None:
        while True:
            # Whoever wants to know why there is no broker reads the companions' logs.
            with suppress(VfguideError):
                async with spectator(address, formation, random) as client:
                    await read(client, found)
            await asyncio.sleep(RETRY_S)

    task = asyncio.create_task(watch(), name="watching presences")
    try:
        yield found
    finally:
        task.cancel()
        await asyncio.wait([task])


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
    async with spectator(address, formation, random) as client:
        with suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                await read(client, found)
    return found


@asynccontextmanager
async def spectator(
    address: LinkAddress, formation: str, random: Random
) -> AsyncIterator[BrokerClient]:
    """A connection to the broker on which the presences of a formation come in.

    Raises:
        VfguideError: the broker does not answer, refuses, or is lost.
    """
    own = f"{address.prefix}/{level(formation)}"
    client = BrokerClient(
        address,
        identifier=f"vfguide-status-{random.getrandbits(32):08x}",
        will=Will(f"{own}/-/watch"),
        queue=asyncio.Queue,
        context=security_of(address),
    )
    # Opening ends by itself, and is not to be cancelled.
    opening = asyncio.ensure_future(client.open())
    try:
        await asyncio.shield(opening)
        await client.subscribe(f"{own}/+/presence")
        yield client
    except MqttError as error:
        raise VfguideError(f"link {address}: {reason_of(error)}") from error
    finally:
        await asyncio.wait([opening])
        if opening.exception() is None:
            await client.close()


async def read(client: BrokerClient, found: dict[str, Presence]) -> None:
    """Note presences as they come, until cancelled.

    Raises:
        MqttError: the broker is lost.
    """
    async for message in client.messages:
        vehicle = message.topic.value.split("/")[-2]
        if isinstance(message.payload, bytes):
            note(found, vehicle, message.payload)


def note(found: dict[str, Presence], vehicle: str, data: bytes) -> None:
    """Keep a presence, unless it is none."""
    try:
        found[vehicle] = decode_presence(data)
    except LinkDataError:
        return
