"""The controller's view of its drives by their PDOs, and the next controlword of each."""

from collections.abc import Callable
from dataclasses import dataclass

from hil_sim.clock import MILLISECOND_NS, Clock
from hil_sim.drive.power_state import PowerState
from hil_sim.node.dictionary import Value

ENABLE_OPERATION = 0x0F
QUICK_STOP = 0x02

_SILENCE_NS = 100 * MILLISECOND_NS  # a drive that shows no statusword for so long has left

# The next controlword on the way up; each is sent only after the statusword has shown the state.
_WAY_UP = {
    PowerState.FAULT: 0x80,
    PowerState.QUICK_STOP_ACTIVE: 0x00,
    PowerState.SWITCH_ON_DISABLED: 0x06,
    PowerState.READY_TO_SWITCH_ON: 0x07,
    PowerState.SWITCHED_ON: ENABLE_OPERATION,
    PowerState.OPERATION_ENABLED: ENABLE_OPERATION,
}
# Statusword masks of CiA 402-2 table 6: bit 5 says nothing in the first four states.
_MASKED_BY_4F = {
    state.value & 0x4F: state
    for state in (
        PowerState.NOT_READY_TO_SWITCH_ON,
        PowerState.SWITCH_ON_DISABLED,
        PowerState.FAULT_REACTION_ACTIVE,
        PowerState.FAULT,
    )
}
_MASKED_BY_6F = {
    state.value: state
    for state in (
        PowerState.READY_TO_SWITCH_ON,
        PowerState.SWITCHED_ON,
        PowerState.OPERATION_ENABLED,
        PowerState.QUICK_STOP_ACTIVE,
    )
}


def power_state_of(statusword: int) -> PowerState | None:
    """Return the drive's state in its statusword, `None` for bits that no state has."""
    return _MASKED_BY_6F.get(statusword & 0x6F) or _MASKED_BY_4F.get(statusword & 0x4F)


@dataclass(slots=True)
class DriveStatus:
    """One drive: its node id, the state that its PDO showed last, and when."""

    node_id: int
    clock: Clock
    state: PowerState | None = None
    stamp_ns: int = 0

    def take(self, statusword: Value) -> None:
        """Its statusword has come."""
        self.state = power_state_of(int(statusword))
        self.stamp_ns = self.clock.now_ns

    @property
    def present(self) -> bool:
        return self.state is not None and self.clock.now_ns - self.stamp_ns <= _SILENCE_NS

    @property
    def enabled(self) -> bool:
        return self.present and self.state is PowerState.OPERATION_ENABLED

    @property
    def way_up(self) -> int:
        """The controlword that brings it one state nearer to operation."""
        return QUICK_STOP if self.state is None else _WAY_UP.get(self.state, QUICK_STOP)


def first(drives: list[DriveStatus], wrong: Callable[[DriveStatus], bool]) -> int | None:
    """Return the node id of the first drive that is `wrong`."""
    return next((seen.node_id for seen in drives if wrong(seen)), None)
