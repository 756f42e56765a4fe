"""What a signed state costs its speaker and each of its listeners, beside one that is not signed.

Run with `.venv/bin/python -m tests.benchmarks.signature_cost [STATES]`; seconds.
"""

import sys
import time

from tests.kit.figures import tell
from tests.kit.link import LEADER, trust_of
from vfguide.link.codec import SIZE
from vfguide.link.envelope import Kind

SESSION = 1
STATES = 2_000
STATE = bytes(SIZE)


def main() -> None:
    """Seal and open so many states, and print the processor time of each."""
    states = int(sys.argv[1]) if sys.argv[1:] else STATES
    for signed in (True, False):
        speaker, listener = (
            trust_of(LEADER, SESSION, signed=signed),
            trust_of("f1", SESSION + 1, signed=signed),
        )
        listener.prove(SESSION, 0.0)
        began_s = time.process_time()
        sealed = [speaker.seal(Kind.STATE, STATE, time_s=0.05 * number) for number in range(states)]
        made_s = time.process_time()
        for number, data in enumerate(sealed):
            listener.believe(listener.read(data), 0.05 * number)
        heard_s = time.process_time()
        tell(
            f"{'signed' if signed else 'not signed'}: {1e6 * (made_s - began_s) / states:.0f} µs to make, "
            f"{1e6 * (heard_s - made_s) / states:.0f} µs to take, {len(sealed[0])} bytes"
        )


if __name__ == "__main__":
    main()
