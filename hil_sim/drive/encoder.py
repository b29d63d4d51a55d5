"""The encoder at the motor: what the drive believes of its position, and how that belief can go wrong."""


class Encoder:
    """Counts at the motor as the drive sees them; both attributes may be set at any time.

    `offset_counts` is added to every reading, as by a disc that has slipped on its shaft; `stuck` freezes
    the reading where it is.
    """

    def __init__(self) -> None:
        self.offset_counts = 0
        self.stuck = False
        self._last = 0.0

    def read(self, counts: float) -> float:
        """What is read where the motor really stands at `counts`."""
        if not self.stuck:
            self._last = counts + self.offset_counts
        return self._last
