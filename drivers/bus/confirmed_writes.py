"""The writes that a device has confirmed since it came up."""

Object = tuple[int, int]


class ConfirmedWrites:
    """Values by their object. One thread at a time writes; any reads, and the bus's thread may `forget`.

    A value counts only after the device's confirmation. From the moment that a write is sent until then, and
    for good where no answer came, nobody knows what the device holds.
    """

    def __init__(self) -> None:
        self._confirmed: dict[Object, bytes] = {}
        self._unsure: set[Object] = set()
        self._before: tuple[Object, bytes | None, bool] | None = None  # of the write under way

    def known(self, key: Object, otherwise: bytes | None = None) -> bytes | None:
        """Return the last confirmed value; `otherwise` if nothing was written.

        `None` where nobody knows.
        """
        if key in self._unsure:
            return None
        value = self._confirmed.get(key, otherwise)
        return None if key in self._unsure else value  # a write may have begun in between

    def is_unsure(self, key: Object) -> bool:
        """Return whether it was written, and nobody knows whether the device took it."""
        return key in self._unsure

    def doubt(self, key: Object) -> None:
        """Note a write about to be sent, whose outcome will not be reported."""
        self._unsure.add(key)
        self._confirmed.pop(key, None)
        if self._before is not None and self._before[0] == key:
            self._before = key, None, True  # also where the one under way is not sent after all

    def begin(self, key: Object) -> None:
        """Note a write about to be sent, whose outcome one of the next three methods will report."""
        before = (key, self._confirmed.get(key), key in self._unsure)
        self.doubt(key)
        self._before = before

    def confirm(self, key: Object, data: bytes) -> None:
        """Note that the device has accepted the write."""
        if self._before is None:
            return  # it has booted meanwhile: before it took it or after, nobody knows
        self._before = None
        self._confirmed[key] = data
        self._unsure.discard(key)

    def withdraw(self) -> None:
        """Note that the write was refused or could not be sent: the known value stays."""
        if self._before is None:
            return
        (key, value, unsure), self._before = self._before, None
        if not unsure:
            if value is not None:
                self._confirmed[key] = value
            self._unsure.discard(key)

    def leave(self) -> None:
        """Note that nobody knows."""
        self._before = None

    def forget(self) -> None:
        """Forget all values after a boot, or a possible one, except a write under way."""
        before, self._before = self._before, None
        self._confirmed.clear()
        self._unsure.intersection_update(() if before is None else before[:1])
