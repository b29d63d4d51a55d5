"""Bus load of a trace: frames and share by node and kind, a second at a time.

Whose a frame is, and what it takes, is told as for the gateway's buses: `drivers.bus.traffic`, `health`.
"""

from collections import Counter
from dataclasses import dataclass

from drivers.bus.frames import ERROR, REMOTE
from drivers.bus.health import bits_per_s
from drivers.bus.traffic import talks
from drivers.trace.files import Captured


@dataclass(frozen=True, slots=True)
class Share:
    """Share of one kind of frame of one node; `percent` is `None` without a known bit rate."""

    kind: str
    node_id: int | None
    frames_per_s: float
    bits_per_s: float
    percent: float | None


@dataclass(frozen=True, slots=True)
class Load:
    """A bus for some time: its shares, the most first, and their sum."""

    seconds: float
    shares: tuple[Share, ...]
    frames_per_s: float
    error_frames: int
    percent: float | None


class Meter:
    """Counts frames; `bitrate` in bit/s, where it is known."""

    def __init__(self, bitrate: int | None) -> None:
        self._bitrate = bitrate
        self._clear()

    def _clear(self) -> None:
        self._frames: Counter[int] = Counter()
        self._bytes: Counter[int] = Counter()
        self._errors = 0

    def take(self, captured: Captured) -> None:
        """Count one frame."""
        if captured.can_id & ERROR:
            self._errors += 1
            return
        can_id = captured.can_id & ~REMOTE
        self._frames[can_id] += 1
        self._bytes[can_id] += len(captured.data)

    def told(self, seconds: float) -> Load:
        """Return the load since the last call, `seconds` ago, and begin anew."""
        amounts = {
            (talk.kind, talk.node_id): talk.frames_per_s for talk in talks(self._bytes.items(), seconds)
        }
        shares = []
        for talk in talks(self._frames.items(), seconds):
            bits = bits_per_s(talk.frames_per_s, amounts[talk.kind, talk.node_id])
            shares.append(Share(talk.kind, talk.node_id, talk.frames_per_s, bits, self._percent(bits)))
        shares.sort(key=lambda share: -share.bits_per_s)
        load = Load(
            seconds,
            tuple(shares),
            sum(share.frames_per_s for share in shares),
            self._errors,
            self._percent(sum(share.bits_per_s for share in shares)),
        )
        self._clear()
        return load

    def _percent(self, bits: float) -> float | None:
        return None if self._bitrate is None else 100 * bits / self._bitrate
