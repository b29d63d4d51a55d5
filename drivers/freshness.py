"""Age of a component's last sample, and the state that follows from it."""

from drivers.samples import ComponentState


def silence_text(age_ms: float | None) -> str:
    """Return the description of a silence of unknown cause."""
    return "no sample has come yet" if age_ms is None else f"no new sample for {age_ms / 1000:.1f} s"


class Freshness:
    """Turns silence into `stale`, then `lost`; counts how often it was silent for too long."""

    def __init__(self, stale_after_s: float, lost_after_s: float) -> None:
        self.stale = 0
        self._stale_after_ns = round(stale_after_s * 1e9)
        self._lost_after_ns = round(lost_after_s * 1e9)
        self._last_ns: int | None = None
        self._connected = False

    def reset(self) -> None:
        """Nothing has come yet."""
        self._last_ns, self._connected, self.stale = None, False, 0

    def seen(self, stamp_ns: int) -> None:
        """Take a sample of `stamp_ns`."""
        if self._last_ns is not None and stamp_ns - self._last_ns > self._stale_after_ns:
            self.stale += 1
        self._last_ns, self._connected = stamp_ns, True

    def disconnected(self) -> None:
        """Nothing can come until the next sample: lost at once, whatever the age."""
        self._connected = False

    def state(self, now_ns: int) -> tuple[ComponentState, float | None]:
        """State by age alone, and the age in ms (`None` before the first sample)."""
        if self._last_ns is None:
            return ComponentState.LOST, None
        age_ns = max(0, now_ns - self._last_ns)
        if age_ns > self._lost_after_ns or not self._connected:
            return ComponentState.LOST, age_ns / 1e6
        return (ComponentState.STALE if age_ns > self._stale_after_ns else ComponentState.OK), age_ns / 1e6
