"""The CiA 402 state machine: every state against every controlword."""

import pytest

from hil_sim.drive.power_state import Command, PowerState, after, command_of

S = PowerState

# Rows: state; columns: what shutdown 06, switch on 07, enable operation 0F, disable voltage 00, quick stop 02
# and fault reset 80 lead to (CiA 402-2 figure 5).
TABLE = {
    S.NOT_READY_TO_SWITCH_ON: (S.NOT_READY_TO_SWITCH_ON,) * 6,
    S.SWITCH_ON_DISABLED: (S.READY_TO_SWITCH_ON, *(S.SWITCH_ON_DISABLED,) * 5),
    S.READY_TO_SWITCH_ON: (
        S.READY_TO_SWITCH_ON,
        S.SWITCHED_ON,
        S.OPERATION_ENABLED,
        S.SWITCH_ON_DISABLED,
        S.SWITCH_ON_DISABLED,
        S.READY_TO_SWITCH_ON,
    ),
    S.SWITCHED_ON: (
        S.READY_TO_SWITCH_ON,
        S.SWITCHED_ON,
        S.OPERATION_ENABLED,
        S.SWITCH_ON_DISABLED,
        S.SWITCH_ON_DISABLED,
        S.SWITCHED_ON,
    ),
    S.OPERATION_ENABLED: (
        S.READY_TO_SWITCH_ON,
        S.SWITCHED_ON,
        S.OPERATION_ENABLED,
        S.SWITCH_ON_DISABLED,
        S.QUICK_STOP_ACTIVE,
        S.OPERATION_ENABLED,
    ),
    S.QUICK_STOP_ACTIVE: (
        S.QUICK_STOP_ACTIVE,
        S.QUICK_STOP_ACTIVE,
        S.OPERATION_ENABLED,
        S.SWITCH_ON_DISABLED,
        S.QUICK_STOP_ACTIVE,
        S.QUICK_STOP_ACTIVE,
    ),
    S.FAULT_REACTION_ACTIVE: (S.FAULT_REACTION_ACTIVE,) * 6,
    S.FAULT: (*(S.FAULT,) * 5, S.SWITCH_ON_DISABLED),
}
CONTROLWORDS = (0x06, 0x07, 0x0F, 0x00, 0x02, 0x80)


@pytest.mark.parametrize("state", list(PowerState))
def test_each_controlword_leads_where_the_standard_says(state: PowerState) -> None:
    for controlword, expected in zip(CONTROLWORDS, TABLE[state], strict=True):
        command = command_of(controlword, previous=0)
        assert command is not None
        assert after(state, command) is expected, f"{state.name} with {controlword:02X}"


@pytest.mark.parametrize("state", list(PowerState))
def test_a_fault_is_seen_in_every_state_but_those_of_a_fault(state: PowerState) -> None:
    expected = state if state in (S.FAULT, S.FAULT_REACTION_ACTIVE) else S.FAULT_REACTION_ACTIVE
    assert after(state, Command.FAULT_DETECTED) is expected


def test_fault_reset_is_an_edge_not_a_level() -> None:
    assert command_of(0x80, previous=0x00) is Command.FAULT_RESET
    assert command_of(0x80, previous=0x80) is None
    assert command_of(0x8F, previous=0x8F) is None


@pytest.mark.parametrize(
    ("controlword", "command"),
    [
        (0x1F, Command.ENABLE_OPERATION),
        (0x0E, Command.SHUTDOWN),
        (0x17, Command.SWITCH_ON),
        (0x0D, Command.DISABLE_VOLTAGE),
        (0x0B, Command.QUICK_STOP),
        (0x0102, Command.QUICK_STOP),
    ],
)
def test_bits_that_do_not_count_are_ignored(controlword: int, command: Command) -> None:
    assert command_of(controlword, previous=0) is command
