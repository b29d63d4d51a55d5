"""Check of PDOs' lengths: a changed length means that another master has remapped the PDO."""

from collections.abc import Callable

ODD = 3  # frames of another length within `WITHIN_S` are no strays
WITHIN_S = 10.0


class Lengths:
    """Length check of one PDO with at least `size` bytes, as it was read; `remapped` is called once."""

    def __init__(self, size: int, remapped: Callable[[], object]) -> None:
        self.usual = 0  # of the first frame that held it all; some devices send more bytes than are mapped
        self._size = size
        self._remapped = remapped
        self._odd: list[int] = []  # when they came

    def fits(self, stamp_ns: int, length: int) -> bool:
        """Return whether something can be made of a frame that is not of the usual length."""
        if not self.usual and length >= self._size:
            self.usual = length
        if self.usual == length:
            return True
        self._odd = [one for one in self._odd if stamp_ns - one < WITHIN_S * 1e9]
        self._odd.append(stamp_ns)
        if self.usual and len(self._odd) == ODD:
            self._remapped()
        return False
