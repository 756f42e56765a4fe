"""What a signed state costs its speaker and each of its listeners, beside one that is not signed."""

import time

from tests.benchmarks.results import Cases
from tests.kit.link import LEADER, trust_of
from vfguide.link.codec import SIZE, Kind

SESSION = 1
STATES = 2_000
STATE = bytes(SIZE)


def cases() -> Cases:
    """Seal and open so many states, and take the processor time of each."""
    for signed in (True, False):
        speaker, listener = (
            trust_of(LEADER, SESSION, signed=signed),
            trust_of("f1", SESSION + 1, signed=signed),
        )
        listener.prove(SESSION, 0.0)
        began_s = time.process_time()
        sealed = [speaker.seal(Kind.STATE, STATE, time_s=0.05 * number) for number in range(STATES)]
        made_s = time.process_time()
        for number, data in enumerate(sealed):
            listener.believe(listener.read(data), 0.05 * number)
        heard_s = time.process_time()
        yield (
            "signed" if signed else "not signed",
            {
                "make_us": 1e6 * (made_s - began_s) / STATES,
                "take_us": 1e6 * (heard_s - made_s) / STATES,
                "bytes": len(sealed[0]),
            },
        )
