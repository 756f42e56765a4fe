"""The embedded broker as a program of its own: it tells its port, and runs until its standard input ends.

So it shares no processor with the program that starts it, and never outlives it. Run with
`python -m vfguide.link.broker_program`.
"""

import asyncio
import signal
import sys

from vfguide.link.broker import embedded_broker


async def serve() -> None:
    """Run a broker until the program that started it is gone."""
    async with embedded_broker() as port:
        sys.stdout.write(f"{port}\n")
        sys.stdout.flush()
        loop = asyncio.get_running_loop()
        await loop.run_in_executor(None, sys.stdin.buffer.read)


if __name__ == "__main__":
    # Ctrl-C is for the rehearsal alone.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    asyncio.run(serve())
