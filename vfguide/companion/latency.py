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

    def add(self, value: float) -> None:
        """Note a value."""
        self.greatest = max(self.greatest, value)
        if len(self._newest) < self._size:
            self._newest.append(value)
        else:
            self._newest[self._next] = value
            self._next = (self._next + 1) % self._size

    def quantile(self, share: float) -> float | None:
        """The value that this share of the newest ones does not exceed; None without any."""
        if not self._newest:
            return None
        ordered = sorted(self._newest)
        return ordered[min(len(ordered) - 1, int(share * len(ordered)))]
