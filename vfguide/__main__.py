"""Entry point of `vfguide` and of `python -m vfguide`.

Nothing is imported at the top: what the program consists of takes a second to load, and Ctrl-C in that second
is no fault of anybody's.
"""

import signal
from types import FrameType

STOPPED = 3


def main() -> None:
    """Run the command line."""
    signal.signal(signal.SIGINT, stop)
    from vfguide.cli import main as command_line

    command_line()


def stop(_number: int, _frame: FrameType | None) -> None:
    """End at Ctrl-C, where a command has no better way.

    Raises:
        SystemExit: always; unlike KeyboardInterrupt nobody makes a traceback or another status of it.
    """
    raise SystemExit(STOPPED)


if __name__ == "__main__":
    main()
