"""Polling of a node that is up: node guarding, and a check for two devices with one node id.

One with a guard time is guarded (CiA 301 §7.2.8); one without a heartbeat, whose user gets no PDOs either, is
probed by SDO where it says nothing.
"""

from drivers.bus.bus import CanBus
from drivers.bus.frames import REMOTE
from drivers.bus.liveness import NodeLife
from drivers.bus.nmt import HEARTBEAT
from drivers.bus.sdo.channel import SdoChannel
from drivers.bus.sdo.worker import SdoWorker
from drivers.errors import Unavailable

DOUBT_S = 0.1  # how often a node is asked that answers twice, to see when it does so no more
PROBE_S = 1.0  # how often a node is asked that has no heartbeat and says nothing
SILENT_S = 3.0  # without a word, though it was asked


def _ask_type(sdo: SdoChannel) -> None:
    sdo.upload(0x1000, 0, attempts=1)


class Asking:
    """Polling of one node, by `tick` of the bus's thread; node guarding if `guard_s`, its period, is set."""

    def __init__(
        self, bus: CanBus, node_id: int, life: NodeLife, worker: SdoWorker, guard_s: float | None
    ) -> None:
        self.guard_s = guard_s
        self.guard_problem: str | None = None
        self.probes = False  # whether it is asked where it says nothing: a user who gets no PDOs wants that
        self._bus = bus
        self._guard_id = (HEARTBEAT + node_id) | REMOTE
        self._life = life
        self._worker = worker
        self._guard_ns = self._doubt_ns = self._probe_ns = 0  # when each is due

    def tick(self, now_ns: int) -> None:
        """Ask a node that is up what is due."""
        if self.guard_s is not None and now_ns >= self._guard_ns:
            self._guard_ns = now_ns + round(self.guard_s * 1e9)
            self._guard(now_ns)
        if self._worker.channel.doubled and now_ns >= self._doubt_ns:
            self._doubt_ns = now_ns + round(DOUBT_S * 1e9)
            self._worker.submit(_ask_type)
        if self.probes and now_ns >= self._probe_ns and self._unheard_s(now_ns) > PROBE_S:
            self._probe_ns = now_ns + round(PROBE_S * 1e9)
            self._worker.submit(_ask_type)

    def silence(self, now_ns: int) -> str | None:
        """Return in words that a node without a heartbeat stopped answering; `None` while it answers."""
        silent_s = self._unheard_s(now_ns)
        if silent_s <= SILENT_S:
            return None
        return f"it has answered nothing for {silent_s:.1f} s: check the node's power and cable"

    def _unheard_s(self, now_ns: int) -> float:
        """Return for how long a probed node has said nothing but PDOs; 0 for those with a heartbeat."""
        if self._life.timeout_s is not None or not self.probes:
            return 0.0
        return (self._life.silent_ms(now_ns) or 0.0) / 1000

    def _guard(self, now_ns: int) -> None:
        """Ask by node guarding; the answer is the node's state and counts as a heartbeat."""
        if self._life.heartbeat_ns is None:
            self._life.heartbeat_ns = now_ns  # from now on silence counts
        try:
            self._bus.send(self._guard_id, b"")
            self.guard_problem = None
        except Unavailable as error:
            self.guard_problem = str(error)
