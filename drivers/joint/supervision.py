"""Judges a joint at the bus's tick, by the newest values: nothing extra is read, and no frame costs more."""

from collections.abc import Callable, Iterable

from drivers.bus.bus import BusUser
from drivers.joint.cia402 import DriveState
from drivers.joint.plausibility import JointCheck, Motion
from drivers.joint.power_inhibit import PowerInhibit
from drivers.joint.quantities import POSITION, STATE
from drivers.latest import Latest
from drivers.reader_stalls import ReaderStalls
from drivers.samples import Channel
from eds import Description

BESIDE_S = 0.03  # PDOs of one SYNC; a velocity that was polled is older the next time


class JointWatch(BusUser):
    """Feeds `check`, about 20 times a second as long as the bus is open."""

    def __init__(self, latest: Latest, standstill: ReaderStalls, description: Description) -> None:
        self.check = JointCheck(latest.component)
        self.held_off = PowerInhibit(description)
        self._latest = latest
        self._standstill = standstill
        self._index = _index(latest.channels)
        self._other: Callable[[int], float | None] = lambda _now_ns: None

    def compare_with(self, other: Latest) -> None:
        """Judge it against the same joint of the other leg."""
        position = _index(other.channels)[POSITION]
        self.check.compare_with(other.component)
        self._other = lambda now_ns: other.read(position, now_ns)[0]

    def restart(self) -> None:
        """Forget everything seen before the drive's restart."""
        self.check.restart()
        self.held_off.restart()

    def bus_closed(self) -> None:
        self.restart()

    def tick(self, now_ns: int) -> None:
        state = self._newest(STATE, now_ns)
        inputs = self._newest("digital_inputs", now_ns)
        self.held_off.update(
            now_ns,
            None if state is None else DriveState(int(state)),
            None if inputs is None else int(inputs),
        )
        if not self._standstill.is_settled(now_ns):
            self.check.skip()
            return
        if not self._standstill.is_even(now_ns):
            self.check.skip()  # it is judged all the same: how far a joint can go meanwhile is known
        position, stamp_ns = self._latest.read(self._index[POSITION], now_ns)
        if position is None or stamp_ns is None:
            return
        mode = self._newest("modes_display", now_ns)
        now = Motion(
            stamp_ns,
            position,
            beside(self._latest, self._index.get("velocity"), stamp_ns, now_ns),
            self._newest("torque", now_ns),
            self._newest("following_error", now_ns),
            None if mode is None else int(mode),
            state == DriveState.OPERATION_ENABLED,
        )
        self.check.update(now, lambda: self._other(now_ns))
        if self.check.was_gap:
            self._standstill.explains()

    def _newest(self, quantity: str, now_ns: int) -> float | None:
        index = self._index.get(quantity)
        return None if index is None else self._latest.read(index, now_ns)[0]


def beside(latest: Latest, index: int | None, stamp_ns: int, now_ns: int) -> float | None:
    """Return a value of about the time of another one.

    One that is only polled now and then says nothing of it.
    """
    value, at_ns = (None, None) if index is None else latest.read(index, now_ns)
    return None if at_ns is None or abs(stamp_ns - at_ns) > BESIDE_S * 1e9 else value


def _index(channels: Iterable[Channel]) -> dict[str, int]:
    return {channel.quantity: index for index, channel in enumerate(channels)}
