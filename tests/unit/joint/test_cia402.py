"""Statuswords to states, as CiA 402-2 codes them."""

import pytest

from drivers.joint.cia402 import QUICK_STOP_OPTIONS, DriveState, drive_state, option_text

S = DriveState


@pytest.mark.parametrize(
    ("statusword", "state"),
    [
        (0x0000, S.NOT_READY_TO_SWITCH_ON),
        (0x0250, S.SWITCH_ON_DISABLED),
        (0x0270, S.SWITCH_ON_DISABLED),  # bit 5 does not matter here
        (0x0231, S.READY_TO_SWITCH_ON),
        (0x0233, S.SWITCHED_ON),
        (0x1637, S.OPERATION_ENABLED),
        (0x0617, S.QUICK_STOP_ACTIVE),
        (0x001F, S.FAULT_REACTION_ACTIVE),
        (0x003F, S.FAULT_REACTION_ACTIVE),
        (0x0218, S.FAULT),
        (0x0238, S.FAULT),
        (0x0001, None),
        (0x0061, None),
        (0x0002, None),
        (0x0067, None),
    ],
)
def test_a_statusword_is_its_state_or_none_of_the_standard(statusword: int, state: DriveState | None) -> None:
    assert drive_state(statusword) is state


def test_operation_enabled_is_never_read_out_of_any_other_pattern() -> None:
    enabled = {word for word in range(0x10000) if drive_state(word) is S.OPERATION_ENABLED}
    assert enabled == {word for word in range(0x10000) if word & 0x6F == 0x27}


@pytest.mark.parametrize(
    ("value", "words"),
    [(2, "slows down on the quick-stop ramp"), (None, "is not told"), (-5, "is the vendor's own (-5)")],
)
def test_an_option_code_in_words(value: int | None, words: str) -> None:
    assert words in option_text(QUICK_STOP_OPTIONS, value)
