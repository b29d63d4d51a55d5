"""A drive that homes, written from CiA 402-2 alone: states, mode 6 and its statusword bits, on a bus."""

from collections.abc import Callable
from dataclasses import dataclass, field

from drivers.joint.cia402 import DriveState
from tests.unit.bus.fake_node import FakeNode
from tests.unit.joint.standard import S, after

STATUS = {
    S.SWITCH_ON_DISABLED: 0x0240,
    S.READY_TO_SWITCH_ON: 0x0221,
    S.SWITCHED_ON: 0x0223,
    S.OPERATION_ENABLED: 0x0227,
    S.QUICK_STOP_ACTIVE: 0x0207,
    S.FAULT: 0x0208,
}
UNDER_WAY, NOT_STARTED, ATTAINED, COMPLETE = 0x0000, 0x0400, 0x1000, 0x1400
FAILED = 0x2400
IDENTITY = {(0x1000, 0): 0x0002_0192, (0x1018, 1): 0, (0x1018, 2): 0x4A44_0001}
SIZES = {0x1016: 4, 0x6007: 2, 0x6041: 2, 0x6060: 1, 0x6061: 1, 0x6098: 1, 0x603F: 2, 0x605A: 2, 0x6073: 2}
OBJECTS = {
    (0x1016, 1): 0,
    (0x1017, 0): 0,
    (0x6007, 0): 3,
    (0x603F, 0): 0,
    (0x605A, 0): 2,
    (0x6060, 0): 8,
    (0x6064, 0): 0,
    (0x6073, 0): 2000,
    (0x6075, 0): 5000,
    (0x6076, 0): 400,
    (0x607C, 0): 0,
    (0x6098, 0): 0,
    (0x6099, 1): 0,
    (0x6099, 2): 0,
    (0x609A, 0): 0,
    (0x60F4, 0): 0,
    (0x6502, 0): 0x3AD,
}


def encoded(index: int, value: int) -> bytes:
    size = SIZES.get(index, 4)
    return (value & (1 << 8 * size) - 1).to_bytes(size, "little")


@dataclass
class HomingDrive(FakeNode):
    """Its joint goes on by `step` counts with each look at its position, and home is at `home`."""

    home: int | None = 400  # None: it is never found
    step: int = 100
    state: DriveState = S.SWITCH_ON_DISABLED
    homing: int = NOT_STARTED
    deaf_to_words: set[int] = field(default_factory=set)
    begins: bool = True
    on_look: Callable[["HomingDrive"], None] = lambda _drive: None

    def __post_init__(self) -> None:
        super().__post_init__()
        self.words: list[int] = []
        self.states = [self.state]
        values = {**IDENTITY, **OBJECTS}
        self.objects = (
            {(0x1016, 0): b"\x01", (0x60E3, 0): b"\x03"}
            | {
                (0x60E3, number): encoded(0x6098, method)
                for number, method in enumerate((17, 37, 35), start=1)
            }
            | {key: encoded(key[0], value) for key, value in values.items()}
            | self.objects
        )

    def __enter__(self) -> "HomingDrive":
        super().__enter__()
        return self

    @property
    def mode(self) -> int:
        return self.objects[0x6060, 0][0]

    def go(self, state: DriveState) -> None:
        if state is not self.state:
            self.state = state
            self.states.append(state)

    def _initiate_upload(self, index: int, subindex: int) -> bytes:
        if index == 0x6064:
            self._move()
        if index == 0x6041:
            self.on_look(self)
        bits = self.homing if self.state is S.OPERATION_ENABLED and self.mode == 6 else 0
        self.objects[0x6041, 0] = (STATUS[self.state] | bits).to_bytes(2, "little")
        self.objects[0x6061, 0] = self.objects[0x6060, 0]
        return super()._initiate_upload(index, subindex)

    def _move(self) -> None:
        if self.state is not S.OPERATION_ENABLED or self.homing not in (UNDER_WAY, ATTAINED):
            return
        position = int.from_bytes(self.objects[0x6064, 0], "little", signed=True)
        if self.homing == ATTAINED:
            self.homing = COMPLETE
        elif self.home is not None and position >= self.home:
            self._home()
        else:
            self.objects[0x6064, 0] = encoded(0x6064, position + self.step)

    def _home(self) -> None:
        self.homing = ATTAINED
        self.objects[0x6064, 0] = self.objects[0x607C, 0]

    def _write(self, index: int, subindex: int, data: bytes) -> None:
        super()._write(index, subindex, data)
        if index == 0x6040:
            self._command(int.from_bytes(data, "little"))

    def _command(self, word: int) -> None:
        before = self.words[-1] if self.words else 0
        self.words.append(word)
        if word in self.deaf_to_words:
            return
        was, stays = self.state, False
        self.go(after(self.state, word, before, stays))
        if self.state is S.QUICK_STOP_ACTIVE:
            self.go(S.SWITCH_ON_DISABLED)  # 605Ah is 2, and it stands at once
        started = word & ~before & 0x10 and was is S.OPERATION_ENABLED and self.mode == 6
        if started and self.begins:
            still = self.objects[0x6098, 0][0] in (35, 37)
            self.homing = UNDER_WAY
            if still:
                self._home()
