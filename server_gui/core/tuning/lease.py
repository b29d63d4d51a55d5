"""The right to write: our lease, and its remaining time."""

import time
from dataclasses import dataclass

from gateway.wire.control import Lease
from server_gui.core.follow import frame_time


@dataclass(slots=True)
class LeaseState:
    """The lease as far as we know it; it ends by itself, with its link, or when given back."""

    until_ns: int | None = None
    asking: bool = False
    problem: str | None = None  # why we do not have it, in the robot's words

    def left_s(self, now_ns: int | None = None) -> float | None:
        """Return seconds that are left, None where we do not hold it."""
        if self.until_ns is None:
            return None
        left_ns = self.until_ns - (frame_time.now_ns() if now_ns is None else now_ns)
        return left_ns / 1e9 if left_ns > 0 else None

    def asked(self) -> None:
        self.asking = True

    def taken(self, lease: Lease) -> None:
        """We hold it from now on."""
        self.until_ns = time.monotonic_ns() + round(lease.expires_s * 1e9)
        self.asking, self.problem = False, None

    def renewed(self, ttl_s: float) -> None:
        """Note that a write took the lease again."""
        self.taken(Lease("", ttl_s))

    def refused(self, why: str) -> None:
        """Note that somebody else has it, or nobody answered."""
        self.asking, self.problem = False, why

    def gone(self) -> None:
        """Given back, or lost with the link."""
        self.until_ns, self.asking = None, False
