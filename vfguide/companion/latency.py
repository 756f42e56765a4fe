"""How long a companion took, and how old what it used was: a few numbers that stay small for ever."""


class Quantiles:
    """Median, 99th percentile and greatest of the newest values of a series."""

    def __init__(self, size: int = 2000) -> None:
        """Keep this many of the newest values."""
        self._size = size
        self._newest: list[float] = []
        self._next = 0
        self.greatest = 0.0
        """Of all values ever."""
        self.last: float | None = None
        """The newest."""

    def add(self, value: float) -> None:
        """Note a value."""
        self.last = value
        self.greatest = max(self.greatest, value)
        if len(self._newest) < self._size:
            self._newest.append(value)
        else:
            self._newest[self._next] = value
            self._next = (self._next + 1) % self._size

    def quantiles(self, *shares: float) -> list[float]:
        """For each share the value that it of the newest ones does not exceed; empty without any values."""
        ordered = sorted(self._newest)
        if not ordered:
            return []
        return [ordered[min(len(ordered) - 1, int(share * len(ordered)))] for share in shares]
