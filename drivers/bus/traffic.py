"""Traffic of a bus: frames a second by kind and node, by CiA 301's pre-defined connection set.

Only of frames that come to us: an interface that filters for us lets no others through.
"""

from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from operator import itemgetter

from drivers.bus.frames import ERROR

LOOK_S = 1.0
STANDARD = 0x7FF  # the largest id of 11 bits
OTHER = "other"
# CiA 301 §7.3.3: function code (id >> 7) → kind; without a node where the low seven bits are 0.
KINDS = {
    0: "NMT",
    1: "EMCY",
    2: "time",
    **dict.fromkeys((3, 5, 7, 9), "TPDO"),
    **dict.fromkeys((4, 6, 8, 10), "RPDO"),
    11: "SDO answer",
    12: "SDO request",
    14: "heartbeat",
}
OF_NO_NODE = {0x080: "SYNC", 0x7E4: "LSS", 0x7E5: "LSS"}
OF_ALL = ("NMT", "time")  # one identifier each
NAMED = 4  # identifiers of a talk that are told
_id_of = itemgetter(1)


@dataclass(frozen=True, slots=True)
class Talk:
    """Frames of one kind; `node_id` is None where they belong to no node.

    `identifiers` are the `NAMED` with the most frames, with SocketCAN's flags (`drivers.bus.frames`).
    """

    kind: str
    node_id: int | None
    frames_per_s: float
    identifiers: tuple[int, ...] = ()


class Traffic:
    """Written by the bus's thread, read by any. It counts ids; what they mean is asked once a second."""

    def __init__(self) -> None:
        self.talks: tuple[Talk, ...] = ()  # of the last second, the most first
        self._counts: Counter[int] = Counter()
        self._since_ns: int | None = None

    def opened(self) -> None:
        """Nothing is known yet."""
        self.talks, self._counts, self._since_ns = (), Counter(), None

    def take(self, frames: Sequence[tuple[int, int, bytes]]) -> None:
        """Count frames that came."""
        self._counts.update(map(_id_of, frames))

    def look(self, now_ns: int) -> None:
        """Tell of the last second, where that is over."""
        if self._since_ns is None:
            self._since_ns, self._counts = now_ns, Counter()
            return
        seconds = (now_ns - self._since_ns) / 1e9
        if seconds >= LOOK_S:
            counts, self._counts, self._since_ns = self._counts, Counter(), now_ns
            self.talks = tuple(talks(counts.items(), seconds))


def talks(counts: Iterable[tuple[int, int]], seconds: float) -> list[Talk]:
    """Return the shares of frames with these ids, the largest first; without error frames."""
    found: defaultdict[tuple[str, int | None], Counter[int]] = defaultdict(Counter)
    for can_id, count in counts:
        if not can_id & ERROR:
            found[kind_of(can_id)][can_id] += count
    made = (
        Talk(*whose, ids.total() / seconds, tuple(one for one, _ in ids.most_common(NAMED)))
        for whose, ids in found.items()
    )
    return sorted(made, key=lambda talk: -talk.frames_per_s)


def kind_of(can_id: int) -> tuple[str, int | None]:
    """Return kind and node of an id."""
    if can_id > STANDARD:
        return OTHER, None
    if can_id in OF_NO_NODE:
        return OF_NO_NODE[can_id], None
    kind, node_id = KINDS.get(can_id >> 7, OTHER), can_id & 0x7F
    if kind in OF_ALL and node_id:
        return OTHER, None
    return (kind, node_id or None) if kind != OTHER else (OTHER, None)
