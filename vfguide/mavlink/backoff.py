"""How long to wait before another try."""

SHORTEST_DELAY = 0.2
"""s, before the first new try."""

LONGEST_DELAY = 5.0
"""s: whoever plugs the cable in again is not kept waiting longer."""

DOUBLINGS = 10
"""More than it takes from the shortest delay to the longest."""


def reconnect_delay(failures: int, share: float) -> float:
    """Seconds to wait after some failures in a row: doubling, bounded, and never in step with others.

    Args:
        failures: in a row, from 1.
        share: random, in [0, 1): companions that lost the same peer do not all come back at once.

    Returns:
        Between half and the whole of 0.2, 0.4, 0.8 ... 5 s.
    """
    doublings = min(max(failures - 1, 0), DOUBLINGS)
    whole = min(SHORTEST_DELAY * 2.0**doublings, LONGEST_DELAY)
    return whole * (0.5 + 0.5 * share)
