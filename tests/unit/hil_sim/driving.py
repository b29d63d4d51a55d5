"""What tests of a joint drive do with it over the bus."""

import math
from collections.abc import Callable

from hil_sim.clock import MILLISECOND_NS
from tests.unit.hil_sim.bench import NODE, Bench

COUNTS_PER_RADIAN = 409_600 / math.tau

# Modes of operation (6060h) and bits of the controlword.
POSITION, VELOCITY, TORQUE, HOMING, CSP, CSV, CST = 1, 3, 4, 6, 8, 9, 10
NEW_SETPOINT, IMMEDIATE, RELATIVE, HALT, ON_SETPOINT = 0x10, 0x20, 0x40, 0x100, 0x200
ENABLE = 0x0F

# Bits of the statusword.
WARNING, REACHED, LIMITED, BIT_12, BIT_13, REDUCED, HOMED = (1 << bit for bit in (7, 10, 11, 12, 13, 14, 15))


def state(bench: Bench) -> int:
    """The power state, as its bits in the statusword."""
    word = bench.read(0x6041)
    return word & 0x4F if word & 0x4F in (0x00, 0x40, 0x0F, 0x08) else word & 0x6F


def enable_in(bench: Bench, mode: int) -> None:
    bench.start()
    enable_now_in(bench, mode)


def enable_now_in(bench: Bench, mode: int) -> None:
    """The same for a drive that is up."""
    assert bench.write(0x6060, 0, mode, 1) == "ok"
    bench.enable()
    assert bench.read(0x6061, signed=True) == mode


def move_to(bench: Bench, target: int, bits: int = 0) -> None:
    assert bench.write(0x607A, 0, target, 4) == "ok"
    bench.controlword(ENABLE | NEW_SETPOINT | bits)
    bench.controlword(ENABLE | bits & ~(IMMEDIATE | RELATIVE | ON_SETPOINT))


def position(bench: Bench) -> int:
    return bench.read(0x6064, signed=True)


def velocity(bench: Bench) -> int:
    return bench.read(0x606C, signed=True)


def torque(bench: Bench) -> int:
    return bench.read(0x6077, signed=True)


def has(bench: Bench, bits: int) -> bool:
    return bench.read(0x6041) & bits == bits


def until(bench: Bench, condition: Callable[[], bool], at_most_ms: int = 5000) -> int:
    """Let time pass until `condition`; gives the milliseconds."""
    start_ns = bench.clock.now_ns
    while (elapsed_ms := (bench.clock.now_ns - start_ns) // MILLISECOND_NS) <= at_most_ms:
        if condition():
            return elapsed_ms
        bench.run(1)
    raise AssertionError(f"nothing in {at_most_ms} ms; statusword {bench.drive.statusword():04X}h")


def cyclic(bench: Bench, cycles: int, target: Callable[[int], int], size: int = 4) -> None:
    """A SYNC every 10 ms, before it the RPDO with its mapping 6040h, 6060h and the target."""
    for cycle in range(cycles):
        data = (ENABLE | bench.read(0x6061, signed=True) << 16).to_bytes(3, "little")
        value = target(cycle) & (1 << 8 * size) - 1
        bench.send(0x200 + NODE, (data + value.to_bytes(size, "little")).hex())
        bench.send(0x080)
        bench.run(4)


def map_target(bench: Bench, index: int, bits: int) -> None:
    """Let RPDO1 carry another target than 607Ah."""
    assert bench.write(0x1400, 1, 0x8000_0200 + NODE, 4) == "ok"
    for subindex, value in ((0, 0), (3, index << 16 | bits), (0, 3)):
        assert bench.write(0x1600, subindex, value, 1 if subindex == 0 else 4) == "ok"
    assert bench.write(0x1400, 1, 0x200 + NODE, 4) == "ok"
