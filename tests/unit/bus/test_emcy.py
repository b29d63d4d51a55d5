"""EMCY frames and error codes in words."""

import pytest

from drivers.bus.emcy import parse_emcy
from drivers.error_codes import error_text

MAXON = 0xFB


@pytest.mark.parametrize(
    ("code", "vendor_id", "words"),
    [
        (0x8611, None, "0x8611 following error too large"),  # CiA 402
        (0x8130, None, "0x8130 life guard or heartbeat error"),  # CiA 301
        (0x2399, None, "0x2399 current, device output side"),  # its class
        (0x7399, None, "0x7399 additional modules"),  # the class above
        (0xFF77, None, "0xFF77 device specific"),
        (0xA000, None, "0xA000 error of an unknown class"),
        (0x8A88, MAXON, "0x8A88 safe torque off (STO)"),  # the vendor's own
        (0x8A88, None, "0x8A88 monitoring"),
        (0x3210, MAXON, "0x3210 DC link overvoltage"),  # not in the vendor's table
    ],
)
def test_a_code_is_told_in_the_vendors_the_profiles_or_its_classes_words(
    code: int, vendor_id: int | None, words: str
) -> None:
    assert error_text(code, vendor_id) == words


def test_an_emcy_frame_is_code_register_and_vendor_data() -> None:
    emcy = parse_emcy(5, bytes.fromhex("11 86 21 01 02 03 04 05"))
    assert emcy is not None
    assert (emcy.stamp_ns, emcy.code, emcy.register, emcy.vendor_data) == (
        5,
        0x8611,
        0x21,
        bytes(range(1, 6)),
    )
    assert emcy.text() == "0x8611 following error too large (register: generic, profile)"
    assert not emcy.resets


def test_code_zero_says_that_the_errors_are_over() -> None:
    emcy = parse_emcy(0, bytes(8))
    assert emcy is not None
    assert emcy.resets


@pytest.mark.parametrize("length", [0, 1, 2])
def test_a_short_frame_is_no_emcy(length: int) -> None:
    assert parse_emcy(0, bytes(length)) is None
