"""A drive of one or two axes from CiA 402, and a gait controller that enables drives as their master does."""

from collections.abc import Sequence

from drivers.joint.cia402 import DriveState
from tests.explore.can import GATEWAY, Sent, Wire
from tests.explore.node import Address, Device, Entry
from tests.unit.joint.standard import after, statusword

AXIS = 0x800
CONTROLWORD, STATUSWORD, POSITION, MAX_TORQUE, RUN = 0x6040, 0x6041, 0x6064, 0x6072, 0x2000
TPDO_S = 0.1
BRAKES_S = 0.08
CYCLE_S = 0.05  # of the controller
COUNTS_PER_TURN = 409_600  # of the joint
STEP_UP = {
    DriveState.SWITCH_ON_DISABLED: 0x06,
    DriveState.READY_TO_SWITCH_ON: 0x07,
    DriveState.SWITCHED_ON: 0x0F,
    DriveState.QUICK_STOP_ACTIVE: 0x0F,
    DriveState.OPERATION_ENABLED: 0x0F,
}
U8, U16, U32, I8, I16, I32 = 0x05, 0x06, 0x07, 0x02, 0x03, 0x04
_COMMON: dict[Address, Entry] = {
    (0x1000, 0): Entry(U32, "ro", 0x20192),
    (0x1001, 0): Entry(U8, "ro"),
    (0x1017, 0): Entry(U16, "rw", 500),
    (0x1018, 0): Entry(U8, "const", 2),
    (0x1018, 1): Entry(U32, "ro", 0),
    (0x1018, 2): Entry(U32, "ro", 0),
}
_STORE: dict[Address, Entry] = {
    (0x1010, 0): Entry(U8, "const", 1),
    (0x1010, 1): Entry(U32, "rw", 1),
}


def drive_entries(axes: int, node_id: int, quick_stop_option: int) -> dict[Address, Entry]:
    """All objects of a drive; its TPDO carries the first axis only."""
    found = (
        _COMMON
        | _STORE
        | {
            (0x1400, 0): Entry(U8, "const", 2),
            (0x1400, 1): Entry(U32, "rw", 0x200 + node_id),
            (0x1400, 2): Entry(U8, "rw", 255),
            (0x1600, 0): Entry(U8, "rw", 2),
            (0x1600, 1): Entry(U32, "rw", CONTROLWORD << 16 | 16),
            (0x1600, 2): Entry(U32, "rw", MAX_TORQUE << 16 | 16),
            (0x1800, 0): Entry(U8, "const", 5),
            (0x1800, 1): Entry(U32, "rw", 0x180 + node_id),
            (0x1800, 2): Entry(U8, "rw", 255),
            (0x1800, 5): Entry(U16, "rw", round(TPDO_S * 1000)),
            (0x1A00, 0): Entry(U8, "rw", 2),
            (0x1A00, 1): Entry(U32, "rw", STATUSWORD << 16 | 16),
            (0x1A00, 2): Entry(U32, "rw", POSITION << 16 | 32),
        }
    )
    for offset in range(0, axes * AXIS, AXIS):
        found |= {
            (0x6007 + offset, 0): Entry(I16, "rw", 3),
            (CONTROLWORD + offset, 0): Entry(U16, "rww"),
            (STATUSWORD + offset, 0): Entry(U16, "ro"),
            (0x605A + offset, 0): Entry(I16, "rw", quick_stop_option),
            (0x6060 + offset, 0): Entry(I8, "rww", 8),
            (0x6061 + offset, 0): Entry(I8, "ro", 8),
            (POSITION + offset, 0): Entry(I32, "ro"),
            (MAX_TORQUE + offset, 0): Entry(U16, "rw", 1000),
            (0x6075 + offset, 0): Entry(U32, "rw", 5000),
            (0x6076 + offset, 0): Entry(U32, "rw", 200),
            (0x607A + offset, 0): Entry(I32, "rww"),
            (0x608F + offset, 0): Entry(U8, "const", 2),
            (0x608F + offset, 1): Entry(U32, "rw", 4096),
            (0x608F + offset, 2): Entry(U32, "rw", 1),
            (0x6091 + offset, 0): Entry(U8, "const", 2),
            (0x6091 + offset, 1): Entry(U32, "rw", 100),
            (0x6091 + offset, 2): Entry(U32, "rw", 1),
        }
    return found


GAIT_ENTRIES: dict[Address, Entry] = _COMMON | {
    (RUN, 0): Entry(U8, "rw"),
    (0x2001, 0): Entry(U16, "rw", 400),
    (0x2002, 0): Entry(U16, "rw", 1200),
}


class Axis:
    """The state machine of one axis, its position, and what may be wrong with it."""

    def __init__(self, drive: "Drive", number: int) -> None:
        self.drive, self.number, self.offset = drive, number, number * AXIS
        self.name = f"{drive.name}/{number}"
        self.pushed = 0.0  # rad, by which something holds the joint away from where it should be
        self.ignores_quick_stop = False
        self.enabled_by = ""  # who enabled it last
        self.state = DriveState.SWITCH_ON_DISABLED
        self._before = 0  # the last controlword
        self.since_ns = 0

    @property
    def enabled(self) -> bool:
        return self.state is DriveState.OPERATION_ENABLED

    def command(self, who: str, controlword: int) -> None:
        state = after(self.state, controlword, self._before, self._stays)
        self._before = controlword
        if self.ignores_quick_stop and state is DriveState.QUICK_STOP_ACTIVE:
            return
        if state is DriveState.OPERATION_ENABLED and not self.enabled:
            self.enabled_by = who
        self.go(state)

    def go(self, state: DriveState) -> None:
        if state is self.state:
            return
        self.state = state
        self.since_ns = now_ns = self.drive.wire.runtime.now_ns
        if state is DriveState.QUICK_STOP_ACTIVE and not self._stays:
            self.drive.wire.runtime.call_in(BRAKES_S, lambda: self._stands(now_ns))
        if self.number == 0:
            self.drive.tell()

    def power_on(self) -> None:
        self.state, self._before = DriveState.SWITCH_ON_DISABLED, 0

    def fail(self) -> None:
        """It goes into fault; that somebody resets it by mistake it must bear."""
        self.go(DriveState.FAULT)

    def position(self) -> int:
        """Counts; an axis that moves is never twice at the same place."""
        runtime = self.drive.wire.runtime
        braking = self.state is DriveState.QUICK_STOP_ACTIVE
        moves = self.enabled or (braking and runtime.now_ns - self.since_ns < BRAKES_S * 1e9)
        wander = runtime.now_ns // 1_000_000 % 997 * 10 if moves else 0
        return wander + round(self.pushed / 6.2832 * COUNTS_PER_TURN)

    @property
    def _stays(self) -> bool:
        return self.drive.get(0x605A + self.offset) >= 5

    def _stands(self, since_ns: int) -> None:
        if self.state is DriveState.QUICK_STOP_ACTIVE and self.since_ns == since_ns:
            self.go(DriveState.SWITCH_ON_DISABLED)


class Drive(Device):
    """Its axes behind one node."""

    def __init__(self, wire: Wire, name: str, node_id: int, axes: int, *, quick_stop_option: int) -> None:
        self.axes: tuple[Axis, ...] = ()
        super().__init__(wire, name, node_id, drive_entries(axes, node_id, quick_stop_option))
        self.axes = tuple(Axis(self, number) for number in range(axes))
        wire.runtime.call_in(0.013 * node_id, self._cycle)

    @property
    def state(self) -> tuple[object, ...]:
        axes = ((one.state, one.pushed, one.ignores_quick_stop) for one in self.axes)
        return (*super().state, *axes)

    def read(self, index: int, subindex: int) -> bytes | None:
        axis = self._axis(index)
        if axis is not None and index == STATUSWORD + axis.offset:
            return statusword(axis.state).to_bytes(2, "little")
        if axis is not None and index == POSITION + axis.offset:
            return axis.position().to_bytes(4, "little", signed=True)
        return super().read(index, subindex)

    def write(self, who: str, index: int, subindex: int, data: bytes) -> None:
        super().write(who, index, subindex, data)
        axis = self._axis(index)
        if axis is not None and index == CONTROLWORD + axis.offset:
            axis.command(who, int.from_bytes(data, "little"))

    def on_rpdo(self, data: bytes) -> None:
        self.write(GATEWAY, CONTROLWORD, 0, data[:2])
        if data[2:4] != self.read(MAX_TORQUE, 0):
            self.write(GATEWAY, MAX_TORQUE, 0, data[2:4])

    def on_power(self) -> None:
        for axis in self.axes:
            axis.power_on()

    def tell(self) -> None:
        """Its TPDO: when it changes, and every `TPDO_S`."""
        data = (self.read(STATUSWORD, 0) or b"") + (self.read(POSITION, 0) or b"")
        self.send_tpdo(data)

    def _cycle(self) -> None:
        self.tell()
        self.wire.runtime.call_in(TPDO_S, self._cycle)

    def _axis(self, index: int) -> Axis | None:
        number = (index - 0x6000) // AXIS
        return self.axes[number] if 0 <= number < len(self.axes) else None


class Controller(Device):
    """As long as its run object says so, it leads every drive up, step by step, and keeps it there."""

    def __init__(self, wire: Wire, name: str, node_id: int, drives: Sequence[Drive]) -> None:
        super().__init__(wire, name, node_id, GAIT_ENTRIES)
        self._drives = drives
        wire.runtime.call_in(CYCLE_S, self._cycle)

    @property
    def runs(self) -> bool:
        return self.get(RUN) != 0

    def _cycle(self) -> None:
        if self.runs and not self.faults.dead:
            for drive in self._drives:
                if not drive.faults.dead and not drive.wire.blocked:
                    self._lead(drive)
        self.wire.runtime.call_in(CYCLE_S, self._cycle)

    def _lead(self, drive: Drive) -> None:
        for axis in drive.axes:
            if axis.state in STEP_UP:
                axis.command(self.name, STEP_UP[axis.state])


def statusword_of(sent: Sent) -> int:
    """What a TPDO of a drive says."""
    return int.from_bytes(sent.data[:2], "little")
