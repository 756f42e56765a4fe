"""Pseudo terminals as radios that share one channel, and states to be said over it."""

import asyncio
import os
from contextlib import suppress
from pathlib import Path

from tests.kit.states import leader_message
from tests.kit.terminal import Plug as Terminal
from vfguide.link.codec import encode
from vfguide.link.keys import key_places, make_radio_key


class Plug(Terminal):
    """A serial port with a radio that can be pulled out and put back."""

    def __init__(self, air: "SharedAir", device: Path) -> None:
        super().__init__(device)
        self._air = air

    def put_in(self) -> None:
        super().put_in()
        self._listen_again(self.near)

    def pull_out(self) -> None:
        if self._near is not None:
            asyncio.get_running_loop().remove_reader(self._near)
        super().pull_out()

    def hear(self, data: bytes) -> None:
        with suppress(OSError):
            if self._near is not None:
                os.write(self._near, data)

    def _read(self, near: int) -> None:
        try:
            data = os.read(near, 4096)
        except OSError:
            # Nobody has the port open.
            asyncio.get_running_loop().remove_reader(near)
            asyncio.get_running_loop().call_later(0.05, self._listen_again, near)
            return
        self._air.send(self, data)

    def _listen_again(self, near: int) -> None:
        if self._near == near:
            asyncio.get_running_loop().add_reader(near, self._read, near)


class SharedAir:
    """What one radio sends arrives at all others, as much later as it takes at 4000 bytes a second."""

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self.plugs: dict[str, Plug] = {}
        places = key_places(directory / "circle.yaml")
        make_radio_key(places)
        self.key = places.radio

    def plug(self, name: str) -> Plug:
        self.plugs[name] = plug = Plug(self, self._directory / f"tty-{name}")
        plug.put_in()
        return plug

    def address(self, name: str, *, key: bool = True) -> str:
        device = self._directory / f"tty-{name}"
        return f"serial://{device}:57600" + (f"?key={self.key}" if key else "")

    def send(self, sender: Plug | None, data: bytes) -> None:
        loop = asyncio.get_running_loop()
        for plug in self.plugs.values():
            if plug is not sender:
                loop.call_later(len(data) / 4000.0, plug.hear, data)

    def close(self) -> None:
        for plug in self.plugs.values():
            plug.pull_out()


def state_at(time_s: float) -> bytes:
    return encode(leader_message(time_s=time_s))
