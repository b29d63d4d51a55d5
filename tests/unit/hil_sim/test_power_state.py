"""The CiA 402 state machine: every state against every controlword."""

from itertools import product

import pytest

from hil_sim.drive.power_state import Command, PowerState, after, command_of

S, C = PowerState, Command

# CiA 402-2 table 4: bits 7, 3, 2, 1, 0 of the controlword; X does not count.
CODING = {
    "0X110": C.SHUTDOWN,
    "00111": C.SWITCH_ON,
    "01111": C.ENABLE_OPERATION,
    "0XX0X": C.DISABLE_VOLTAGE,
    "0X01X": C.QUICK_STOP,
}

# Figure 5: number of the transition, from, by which commands, to. In READY TO SWITCH ON "enable operation"
# runs through 3 and 4; the drive itself decides when 12, 14 and 16 are possible.
FIGURE = (
    (1, S.NOT_READY_TO_SWITCH_ON, (C.BOOTED,), S.SWITCH_ON_DISABLED),
    (2, S.SWITCH_ON_DISABLED, (C.SHUTDOWN,), S.READY_TO_SWITCH_ON),
    (3, S.READY_TO_SWITCH_ON, (C.SWITCH_ON,), S.SWITCHED_ON),
    (3, S.READY_TO_SWITCH_ON, (C.ENABLE_OPERATION,), S.OPERATION_ENABLED),
    (4, S.SWITCHED_ON, (C.ENABLE_OPERATION,), S.OPERATION_ENABLED),
    (5, S.OPERATION_ENABLED, (C.SWITCH_ON,), S.SWITCHED_ON),
    (6, S.SWITCHED_ON, (C.SHUTDOWN,), S.READY_TO_SWITCH_ON),
    (7, S.READY_TO_SWITCH_ON, (C.QUICK_STOP, C.DISABLE_VOLTAGE), S.SWITCH_ON_DISABLED),
    (8, S.OPERATION_ENABLED, (C.SHUTDOWN,), S.READY_TO_SWITCH_ON),
    (9, S.OPERATION_ENABLED, (C.DISABLE_VOLTAGE,), S.SWITCH_ON_DISABLED),
    (10, S.SWITCHED_ON, (C.QUICK_STOP, C.DISABLE_VOLTAGE), S.SWITCH_ON_DISABLED),
    (11, S.OPERATION_ENABLED, (C.QUICK_STOP,), S.QUICK_STOP_ACTIVE),
    (12, S.QUICK_STOP_ACTIVE, (C.DISABLE_VOLTAGE, C.STANDSTILL), S.SWITCH_ON_DISABLED),
    (14, S.FAULT_REACTION_ACTIVE, (C.STANDSTILL,), S.FAULT),
    (15, S.FAULT, (C.FAULT_RESET,), S.SWITCH_ON_DISABLED),
    (16, S.QUICK_STOP_ACTIVE, (C.ENABLE_OPERATION,), S.OPERATION_ENABLED),
)
NEXT = {(start, command): end for _, start, commands, end in FIGURE for command in commands}


def expected_command(controlword: int, previous: int) -> Command | None:
    if controlword & 0x80 and not previous & 0x80:
        return C.FAULT_RESET
    bits = "".join("1" if controlword >> bit & 1 else "0" for bit in (7, 3, 2, 1, 0))
    fitting = [
        command
        for pattern, command in CODING.items()
        if all(p in ("X", b) for p, b in zip(pattern, bits, strict=True))
    ]
    assert len(fitting) <= 1, f"{controlword:04X}h has two meanings"
    return fitting[0] if fitting else None


@pytest.mark.parametrize("previous", [0x0000, 0x000F, 0x0080, 0xFFFF])
def test_every_controlword_is_the_command_of_the_standards_table(previous: int) -> None:
    by_bits = {bits: expected_command(bits, previous) for bits in range(0x100)}
    wrong = [word for word in range(0x10000) if command_of(word, previous) is not by_bits[word & 0xFF]]
    assert wrong == []


@pytest.mark.parametrize("state", list(PowerState))
def test_every_state_goes_by_every_controlword_where_the_figure_says(state: PowerState) -> None:
    for bits, previous in product(range(0x100), (0x00, 0x80)):
        command = command_of(bits, previous)
        if command is not None:
            expected = NEXT.get((state, command), state)
            assert after(state, command) is expected, f"{state.name} with {bits:02X}h"


@pytest.mark.parametrize("state", list(PowerState))
def test_every_state_knows_what_the_drive_itself_sees(state: PowerState) -> None:
    for command in (C.BOOTED, C.STANDSTILL):
        assert after(state, command) is NEXT.get((state, command), state)
    in_fault = state in (S.FAULT, S.FAULT_REACTION_ACTIVE)
    assert after(state, C.FAULT_DETECTED) is (state if in_fault else S.FAULT_REACTION_ACTIVE)  # 13


def test_nothing_but_enable_operation_leads_to_operation_enabled() -> None:
    leading = {
        command
        for state, command in product(PowerState, Command)
        if after(state, command) is S.OPERATION_ENABLED and state is not S.OPERATION_ENABLED
    }
    assert leading == {C.ENABLE_OPERATION}


def test_fault_reset_is_an_edge_not_a_level() -> None:
    assert command_of(0x80, previous=0x00) is C.FAULT_RESET
    assert command_of(0x80, previous=0x80) is None
    assert command_of(0x8F, previous=0x8F) is None
