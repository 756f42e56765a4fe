"""Abilities that not every system has."""

import asyncio
import os
import socket

import pytest

from vfguide.errors import VfguideError
from vfguide.regular_file import read_by_others
from vfguide.system import SocketSelector, require_linux, run_watching_sockets


def test_its_loop_watches_a_socket_and_its_selector_tells_whether_something_has_arrived():
    near, far = socket.socketpair()

    async def heard() -> bytes:
        arrived = asyncio.Event()
        asyncio.get_running_loop().add_reader(near, arrived.set)
        far.send(b"here")
        await arrived.wait()
        return near.recv(4)

    with near, far, SocketSelector() as selector:
        assert run_watching_sockets(heard()) == b"here"
        selector.register(near, 1)
        assert not selector.select(0)
        far.send(b"here")
        assert selector.select(0)


def test_permissions_count_where_files_have_owners(tmp_path, monkeypatch):
    file = tmp_path / "key"
    file.touch(mode=0o600)
    assert not read_by_others(file.stat())
    file.chmod(0o640)
    assert read_by_others(file.stat())
    monkeypatch.delattr(os, "geteuid")
    assert not read_by_others(file.stat())


def test_what_only_linux_can_do_is_refused_elsewhere(monkeypatch):
    require_linux("to fly backwards")
    monkeypatch.delattr(os, "memfd_create")
    with pytest.raises(VfguideError, match="to fly backwards needs Linux; on this computer"):
        require_linux("to fly backwards")
