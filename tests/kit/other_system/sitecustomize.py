"""Loaded by Python at its start: takes away what macOS or Windows lacks, unless Python itself needs it."""

import asyncio
import importlib.abc
import os
import select
import signal
import socket
import subprocess  # noqa: F401 - finds what it needs before it is gone
import sys
from contextlib import suppress
from typing import Any, NoReturn

MODULES = {
    "curses",
    "fcntl",
    "grp",
    "pty",
    "pwd",
    "readline",
    "resource",
    "syslog",
    "termios",
    "tty",
}

NAMES: dict[Any, str] = {
    os: """
        O_DIRECTORY O_NOCTTY O_NOFOLLOW O_NONBLOCK PRIO_PROCESS chown fchmod fchown fork forkpty
        getegid geteuid getgid getloadavg getpgid getpriority getuid killpg memfd_create mkfifo nice openpty
        posix_fallocate pread pwrite register_at_fork sched_getaffinity sendfile setpriority setsid
        setuid statvfs sync sysconf ttyname wait3 wait4
    """,
    select: "epoll kqueue poll",
    signal: """
        SIGALRM SIGCONT SIGHUP SIGPIPE SIGQUIT SIGSTOP SIGTSTP SIGUSR1 SIGUSR2 SIGWINCH SIG_BLOCK
        SIG_SETMASK SIG_UNBLOCK alarm pause pthread_sigmask setitimer siginterrupt sigpending sigwait
    """,
    socket: """
        AF_NETLINK AF_PACKET CMSG_LEN CMSG_SPACE MSG_DONTWAIT MSG_NOSIGNAL SCM_RIGHTS SO_BINDTODEVICE
        SO_REUSEPORT TCP_USER_TIMEOUT
    """,
}

# Libraries that choose their parts by the system's name, which stays Linux's.
with suppress(ImportError):
    import psutil  # noqa: F401
    import serial_asyncio_fast  # noqa: F401


class Others:
    """A finder of modules that knows nothing of some."""

    def __init__(self, finder: importlib.abc.MetaPathFinder) -> None:
        self._finder = finder

    def find_spec(self, name: str, path: Any = None, target: Any = None) -> Any:
        return None if name in MODULES else self._finder.find_spec(name, path, target)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._finder, name)


def not_here(*_: object) -> NoReturn:
    raise NotImplementedError


class DefaultLoop(asyncio.SelectorEventLoop):
    """Like Windows' default kind of loop it does not watch sockets for others."""

    add_reader = add_writer = remove_reader = remove_writer = not_here


sys.meta_path[:] = [Others(one) for one in sys.meta_path]
for module in MODULES:
    sys.modules.pop(module, None)
for place, names in NAMES.items():
    for one in names.split():
        vars(place).pop(one, None)
for call in ("add_signal_handler", "remove_signal_handler"):
    setattr(asyncio.SelectorEventLoop, call, not_here)
asyncio.DefaultEventLoopPolicy._loop_factory = DefaultLoop  # noqa: SLF001
