"""What the processes of one search share: counters, and a table of what was seen."""

import mmap
import struct
from enum import IntEnum

SLOTS = 1 << 22
_PROBES = 16


class Count(IntEnum):
    """What is counted."""

    RUNS = 0
    ORDERS = 1  # that differ
    STATES = 2  # that differ
    VIRTUAL_MS = 3
    STEPS = 4
    CUT = 5  # branches that led where others had been


class Shared:
    """One process writes at a time in each worker; two workers at once lose a count now and then, no more."""

    def __init__(self, workers: int) -> None:
        self.worker = 0
        self._workers = workers
        self._counts = mmap.mmap(-1, 8 * len(Count) * workers)
        self._seen = mmap.mmap(-1, 8 * SLOTS)

    def add(self, what: Count, number: int = 1) -> None:
        at = 8 * (self.worker * len(Count) + what)
        (before,) = struct.unpack_from("<Q", self._counts, at)
        struct.pack_into("<Q", self._counts, at, before + number)

    def total(self, what: Count) -> int:
        ats = (8 * (worker * len(Count) + what) for worker in range(self._workers))
        return sum(struct.unpack_from("<Q", self._counts, at)[0] for at in ats)

    def is_new(self, key: int) -> bool:
        """Whether nobody has asked about this key before; a full table says no."""
        key = key & 0xFFFF_FFFF_FFFF_FFFF or 1
        data, view = key.to_bytes(8, "little"), self._seen
        for probe in range(_PROBES):
            at = 8 * ((key + probe) % SLOTS)
            found = view[at : at + 8]
            if found == data:
                return False
            if found == bytes(8):
                view[at : at + 8] = data
                return True
        return False
