"""A connection to the broker that comes back by itself."""

import asyncio
import logging
import secrets
import ssl
from contextlib import suppress
from dataclasses import replace
from random import Random

from aiomqtt import MqttError, Will

from vfguide.backoff import retry_delay
from vfguide.link.address import MqttAddress
from vfguide.link.client import BrokerClient, reason_of
from vfguide.link.inbox import Inbox
from vfguide.link.session import Parts, Session

logger = logging.getLogger(__name__)

STABLE_S = 5.0
"""A connection that lasted this long was a success: the next try follows soon."""

GOODBYE_S = 0.5
"""s that a broker gets to hear that this vehicle is leaving; one that does not answer finds out by itself."""

IDENTIFIER_BYTES = 8
"""Of chance in the name of a client."""


class Reconnecting:
    """Keeps a link connected until told to stop."""

    def __init__(
        self, address: MqttAddress, security: ssl.SSLContext | None, parts: Parts, random: Random
    ) -> None:
        self._address = address
        self._security = security
        self._parts = parts
        self._random = random
        self._stop = asyncio.Event()
        self._topic = parts.topics.presence(parts.topics.vehicle)
        # The same name each time: the broker then ends what is left of an earlier connection before this one
        # speaks, and not some seconds later, with "offline". Nobody can guess it: a broker ends the
        # connection of a client when another calls itself the same, whatever that other may read or write.
        self._identifier = (
            f"{self._topic.removesuffix('/presence')}/{secrets.token_hex(IDENTIFIER_BYTES)}"
        )

    def stop(self) -> None:
        """Say goodbye; `run` ends soon after, within seconds even if the broker does not answer."""
        self._stop.set()

    async def run(self) -> None:
        """Connect, and again whenever the connection is lost."""
        loop, failures = asyncio.get_running_loop(), 0
        while not self._stop.is_set():
            began = loop.time()
            try:
                await self._visit()
                reason = "closed"
            except (MqttError, OSError) as error:
                reason = reason_of(error)
            except Exception as error:
                # Whatever it is, a vehicle in the air is better off with another try.
                logger.exception("link: unforeseen")
                reason = reason_of(error)
            if self._stop.is_set():
                return
            failures = 1 if loop.time() - began >= STABLE_S else failures + 1
            self._parts.status.down(reason)
            with suppress(TimeoutError):
                async with asyncio.timeout(retry_delay(failures, self._random.random())):
                    await self._stop.wait()

    async def _visit(self) -> None:
        """One connection, from the call to its end."""
        parts = self._parts
        inbox = Inbox(parts.status.counters)
        client = BrokerClient(
            self._address,
            identifier=self._identifier,
            will=None if parts.member.watches else self._will(),
            queue=inbox.as_queue(),
            context=self._security,
        )
        await self._open(client)
        try:
            session = Session(client, inbox, parts)
            await session.run(self._stop)
            if not parts.member.watches:
                goodbye = replace(parts.presence, status="offline")
                await session.announce(goodbye, patience_s=GOODBYE_S)
        finally:
            await client.close()

    def _will(self) -> Will:
        """What the broker is to say once it has lost this vehicle."""
        member, presence = self._parts.member, self._parts.presence
        offline = replace(presence, status="offline", time_s=member.clock(), figures={})
        return Will(self._topic, member.presence(offline, will=True).data, qos=1, retain=True)

    async def _open(self, client: BrokerClient) -> None:
        """Connect; a stop meanwhile does not wait for an answer.

        Raises:
            MqttError: it does not work.
        """
        opening = asyncio.ensure_future(client.open())
        stopping = asyncio.ensure_future(self._stop.wait())
        try:
            await asyncio.wait({opening, stopping}, return_when=asyncio.FIRST_COMPLETED)
            if not opening.done():
                client.give_up()
            await opening
        finally:
            stopping.cancel()
