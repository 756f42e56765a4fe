"""Serial ports, which come and go with their cables. Eight bits, no parity, no flow control."""

import asyncio
import termios

from serial_asyncio_fast import create_serial_connection

from vfguide.mavlink.address import SerialAddress
from vfguide.mavlink.reconnecting import Dial
from vfguide.mavlink.stream import StreamPeer


def dial_serial(address: SerialAddress) -> Dial:
    """How to open this port, for this process alone."""

    async def dial(peer: StreamPeer) -> str:
        loop = asyncio.get_running_loop()
        try:
            await create_serial_connection(
                loop, lambda: peer, address.device, baudrate=address.baud, exclusive=True
            )
        except termios.error as error:
            # What pyserial lets through when a port goes away while it is being opened.
            raise OSError(*error.args) from error
        return "the port is open"

    return dial
