"""Entry point of `vfguide` and of `python -m vfguide`.

Nothing is imported at the top. The program takes a second to load, and Ctrl-C in that second must end it
cleanly.
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
    """End at Ctrl-C, unless a command has its own handler.

    Raises:
        SystemExit: always; unlike KeyboardInterrupt it causes no traceback and keeps its status.
    """
    raise SystemExit(STOPPED)


if __name__ == "__main__":
    main()
