"""How long to wait before another try."""

SHORTEST_DELAY = 0.2
"""s, before the first new try: most losses are a matter of a moment."""

LONGEST_DELAY = 1.0
"""s: a formation flies blind until all are back, and a hundred that call once a second are no load."""

GROWTH = 1.5
"""How many times longer each delay is than the one before."""

STEPS = 10
"""More than it takes from the shortest delay to the longest."""


def retry_delay(failures: int, share: float) -> float:
    """Seconds to wait after some failures in a row: growing, bounded, and never in step with others.

    Args:
        failures: in a row, from 1.
        share: random, in [0, 1): companions that lost the same peer do not all come back at once.

    Returns:
        Between half and the whole of 0.2, 0.3, 0.45, 0.675, 1, 1 ... s.
    """
    steps = min(max(failures - 1, 0), STEPS)
    whole = min(SHORTEST_DELAY * GROWTH**steps, LONGEST_DELAY)
    return whole * (0.5 + 0.5 * share)
