"""Arms a drive to stop by itself when our heartbeat stays away (1016h: CiA 301 §7.5.2.18; 6007h: CiA 402-2).

Only what the drive itself confirms counts: its 6007h says that it acts, and its 1016h holds our entry. An
entry of anybody else is never touched.
"""

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from functools import partial

from drivers.bus.heartbeat import Heartbeat
from drivers.bus.liveness import HEARTBEATS_MISSED
from drivers.bus.node import Node
from drivers.bus.sdo.channel import SdoChannel
from drivers.bus.values import unsigned
from drivers.errors import DeviceAbort, DriverError, Mismatch

CONSUMER, ABORT_CONNECTION = 0x1016, 0x6007
ACTING = (1, 2, 3)  # the option codes of 6007h that do something; 0 does nothing, others are the vendor's own
CHECK_S = 2.0  # how often it is looked whether the drive is still armed
NOT_UP = "not armed: it has not come up"


class NotArmed(DriverError):
    """The drive cannot be armed; why, and what to do."""


class Arming:
    """One node. It arms whenever the node comes up, and looks again and again (a `NodeUser`).

    `axes` are the offsets of the drive's axes in its dictionary; each must act. `changed` is called, in the
    bus's or worker's thread, when `armed` or `text` did change.
    """

    def __init__(
        self, node: Node, heartbeat: Heartbeat, axes: Sequence[int], changed: Callable[[], None]
    ) -> None:
        self.armed = False
        self.text = NOT_UP  # what is known of it, in words
        self.node = node
        self.consumer_ms = round(heartbeat.period_s * HEARTBEATS_MISSED * 1000)
        self._heartbeat = heartbeat
        self._axes = tuple(axes)
        self._changed = changed
        self._ours = heartbeat.node_id << 16 | self.consumer_ms
        self._lock = threading.Lock()
        self._life = 0  # counts the lives of the node, so that nothing is said of one that is over
        self._entry: int | None = None  # sub-index of 1016h
        self._end_checks: Callable[[], None] = lambda: None

    def start(self) -> None:
        """Arm the node as soon as it is up."""
        self.node.attach(self, "guard")

    def stop(self) -> None:
        """Look no more. The drive stays as it is: disarm it first."""
        self.node.detach(self)

    def disarm(self) -> Future[None]:
        """Free our entry, and read back that it is free.

        It fails with a `DriverError` where the drive does not confirm it: then take it for armed.
        """
        with self._lock:
            self._life += 1
            self._end_checks()
        return self.node.run(self._disarm)

    # What the node tells.

    def boot(self, _sdo: SdoChannel) -> None:
        with self._lock:
            self._life += 1
            self._end_checks()
            self._end_checks = self.node.worker.repeat(CHECK_S, partial(self._check, self._life))

    def forget(self) -> None:
        with self._lock:
            self._life += 1
            self._end_checks()
            self._entry = None
        self._say(self._life, armed=False, text=NOT_UP)

    # In the node's worker.

    def _check(self, life: int, sdo: SdoChannel) -> None:
        try:
            self._arm(sdo)
        except DriverError as error:
            self._say(life, armed=False, text=f"not armed: {error}")
        else:
            self._say(life, armed=True, text=f"armed by 1016h:{self._entry}, {self.consumer_ms} ms")

    def _arm(self, sdo: SdoChannel) -> None:
        if self._heartbeat.problem is not None:
            raise NotArmed(self._heartbeat.problem)
        if self.node.distrust is not None:
            raise NotArmed(self.node.distrust)
        for offset in self._axes:
            _check_reaction(sdo, ABORT_CONNECTION + offset)
        if self._entry is None or unsigned(sdo.upload(CONSUMER, self._entry)[:4]) != self._ours:
            self._take_entry(sdo)
        if not self.armed:
            self._heartbeat.beat()  # a device begins to watch with the first one that it hears

    def _take_entry(self, sdo: SdoChannel) -> None:
        """Write the entry that has our node id already, else the first one that is free."""
        entries = _entries(sdo)
        ours = [at for at, value in entries.items() if value >> 16 & 0xFF == self._heartbeat.node_id]
        free = [at for at, value in entries.items() if value == 0]
        if not ours and not free:
            watched = ", ".join(str(value >> 16 & 0xFF) for value in entries.values())
            raise NotArmed(
                f"all {len(entries)} entries of its 1016h are taken, by heartbeats of the nodes {watched}: "
                "free one of them"
            )
        self._entry = (ours or free)[0]
        if entries[self._entry] != self._ours:
            _write(sdo, self._entry, self._ours)

    def _disarm(self, sdo: SdoChannel) -> None:
        if self._entry is not None:
            _write(sdo, self._entry, 0)
        self._entry = None
        self._say(self._life, armed=False, text="not armed: disarmed")

    def _say(self, life: int, *, armed: bool, text: str) -> None:
        with self._lock:
            if life != self._life or (armed, text) == (self.armed, self.text):
                return
            self.armed, self.text = armed, text
        self._changed()


def _check_reaction(sdo: SdoChannel, index: int) -> None:
    """Refuse a drive that would not act on a lost heartbeat, or of which nobody knows what it would do."""
    try:
        option = int.from_bytes(sdo.upload(index, 0)[:2], "little", signed=True)
    except DeviceAbort as error:
        raise NotArmed(f"it does not tell what it does when communication is lost ({error})") from error
    if option == 0:
        raise NotArmed(f"its {index:04X}h is 0, so it would keep moving: set it to 1, 2 or 3")
    if option not in ACTING:
        raise NotArmed(f"its {index:04X}h is {option}, the vendor's own, and nobody knows what that does")


def _entries(sdo: SdoChannel) -> dict[int, int]:
    """Return every entry of 1016h by its sub-index: node id << 16 | time in ms."""
    try:
        count = unsigned(sdo.upload(CONSUMER, 0)[:1])
    except DeviceAbort as error:
        raise NotArmed(f"it cannot watch heartbeats: it has no 1016h ({error})") from error
    return {number: unsigned(sdo.upload(CONSUMER, number)[:4]) for number in range(1, count + 1)}


def _write(sdo: SdoChannel, entry: int, value: int) -> None:
    sdo.download(CONSUMER, entry, value.to_bytes(4, "little"))
    held = unsigned(sdo.upload(CONSUMER, entry)[:4])
    if held != value:
        raise Mismatch(
            f"{sdo.label}: 0x{CONSUMER:04X}:{entry:02X} holds 0x{held:08X} after 0x{value:08X} was written"
        )
