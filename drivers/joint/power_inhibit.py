"""Inputs that keep the motor without power although nothing is wrong, as STO does."""

from collections.abc import Mapping

from drivers.joint.cia402 import DriveState
from eds import Description

INTERLOCK = {3: "interlock"}  # 60FDh, CiA 402-2; bits from 16 on are the maker's own
# By vendor id and product code: bits of 60FDh at which nothing enables the drive.
_TAKING: dict[tuple[int, int], dict[int, str]] = {
    (0x0000, 0x4A44_0001): {16: "STO"},  # the simulated joint drive
}
_POSSIBLE = 0xFFFF_0008  # bits that may be such ones on a drive that nobody knows
_SETTLED_NS = 1_000_000_000  # inputs are asked seldom: what is newer may be what ended it


class PowerInhibit:
    """Fed with what is known of one joint anyway; `words` is `None` where no input explains anything."""

    def __init__(self, description: Description) -> None:
        self.words: str | None = None
        own = _TAKING.get((description.vendor_id or 0, description.product_code or 0), {})
        self._names: Mapping[int, str] = {**INTERLOCK, **own}
        self._enabled: int | None = None  # the inputs while it was enabled
        self._candidate: tuple[int, int] | None = None  # and those that may be it, since when

    def restart(self) -> None:
        """Forget everything seen before the drive's restart."""
        self.words, self._enabled, self._candidate = None, None, None

    def update(self, now_ns: int, state: DriveState | None, inputs: int | None) -> None:
        """State and 60FDh as they are known now."""
        self.words = None
        if state is DriveState.OPERATION_ENABLED and inputs is not None:
            self._learn(now_ns, inputs)
        elif state is DriveState.SWITCH_ON_DISABLED and inputs is not None:
            self.words = self._explain(inputs)

    def _learn(self, now_ns: int, inputs: int) -> None:
        if self._candidate is None or self._candidate[0] != inputs:
            self._candidate = inputs, now_ns
        elif now_ns - self._candidate[1] > _SETTLED_NS:
            self._enabled = inputs

    def _explain(self, inputs: int) -> str | None:
        known = [f"{name} (60FDh bit {bit})" for bit, name in self._names.items() if inputs >> bit & 1]
        if known:
            return (
                f"the drive is off: {' and '.join(known)} holds it; nothing enables it until that is released"
            )
        new = 0 if self._enabled is None else inputs & ~self._enabled & _POSSIBLE
        bits = [str(bit) for bit in range(32) if new >> bit & 1]
        if not bits:
            return None
        return (
            f"the drive went off as bit {' and '.join(bits)} of its inputs (60FDh) was set: is that its STO?"
        )
