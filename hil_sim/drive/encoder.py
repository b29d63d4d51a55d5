"""The encoder at the motor: what the drive believes of its position, and how that belief can go wrong."""


class Encoder:
    """Position of the motor as the drive sees it; both attributes may be set at any time.

    `offset_counts` is added to every reading, as by a disc that has slipped on its shaft; `stuck` freezes
    the reading where it is.
    """

    def __init__(self, counts_per_radian: float) -> None:
        self.offset_counts = 0
        self.stuck = False
        self._counts_per_radian = counts_per_radian
        self._last = 0.0

    def read(self, radians: float) -> float:
        """Return the reading (rad at the joint) while the motor really stands at `radians`."""
        if not self.stuck:
            self._last = radians + self.offset_counts / self._counts_per_radian
        return self._last
