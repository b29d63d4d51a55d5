"""Numbers of every type go to a device and back exactly, or are refused."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from eds.datatypes import DATA_TYPES
from gateway.coding import EXACT_COUNTS, Coding, CodingError, Number

NUMBERS = {
    code: one for code, one in DATA_TYPES.items() if one.kind in ("boolean", "signed", "unsigned", "real")
}


@pytest.mark.parametrize("code", NUMBERS)
def test_the_ends_of_every_integer_type_go_there_and_back(code: int) -> None:
    known, coding = NUMBERS[code], Coding(code)
    if known.kind == "real":
        return
    bits = known.bits or 0
    low = -(1 << bits - 1) if known.kind == "signed" else 0
    high = (1 << (bits - 1 if known.kind == "signed" else bits)) - 1
    for number in (low, low + 1, high - 1, high):
        data = coding.encode(number)
        assert len(data) == (bits + 7) // 8
        decoded = coding.decode(data)
        assert (decoded, type(decoded)) == (number, int)
    for number in (low - 1, high + 1):
        with pytest.raises(CodingError, match=r"does not fit|neither 0 nor 1"):
            coding.encode(number)


@given(st.sampled_from([code for code, one in NUMBERS.items() if one.kind != "real"]), st.data())
def test_an_integers_bytes_survive_reading_and_writing_back_at_any_scale(
    code: int, data: st.DataObject
) -> None:
    bits = NUMBERS[code].bits or 0
    held = data.draw(st.integers(0, (1 << bits) - 1)).to_bytes((bits + 7) // 8, "little")
    coding = Coding(code, data.draw(st.sampled_from([1.0, 0.001, 0.04, -0.5, 10.0, 1.5339807878856412e-05])))
    number = int.from_bytes(held, "little", signed=NUMBERS[code].kind == "signed")
    try:
        value = coding.decode(held)
    except CodingError:
        assert abs(number) >= EXACT_COUNTS
        assert not coding.scale.is_integer()
    else:
        assert coding.encode(value) == held


@given(st.floats(allow_nan=False, allow_infinity=False, width=32))
def test_a_real32_is_told_as_the_device_stores_it(number: float) -> None:
    coding = Coding(0x08)
    data = coding.encode(number)
    assert data == struct.pack("<f", number)
    assert coding.encode(coding.decode(data)) == data
    assert struct.pack("<d", coding.decode(data)) == struct.pack("<d", number)


def test_a_real_that_a_device_rounds_is_answered_rounded() -> None:
    assert Coding(0x08).decode(Coding(0x08).encode(0.1)) == struct.unpack("<f", struct.pack("<f", 0.1))[0]
    assert Coding(0x11).decode(Coding(0x11).encode(0.1)) == 0.1


@pytest.mark.parametrize(
    ("coding", "value"),
    [
        (Coding(0x1B), 2.0**53),  # a float of that size may have been another number
        (Coding(0x1B, 0.001), 1e16),
        (Coding(0x08), 1e39),
        (Coding(0x11, 1e-300), 1e300),
        (Coding(0x01), 2),
    ],
)
def test_what_would_not_arrive_exactly_is_refused(coding: Coding, value: Number) -> None:
    with pytest.raises(CodingError):
        coding.encode(value)


@pytest.mark.parametrize(
    ("coding", "data"),
    [
        (Coding(0x08), struct.pack("<f", float("nan"))),
        (Coding(0x11), struct.pack("<d", float("inf"))),
        (Coding(0x08), b"\x00\x00"),
        (Coding(0x01), b"\x02"),
        (Coding(0x07), b""),
        (Coding(0x1B, 0.1), b"\xff" * 8),
    ],
)
def test_what_is_no_number_is_no_value(coding: Coding, data: bytes) -> None:
    with pytest.raises(CodingError):
        coding.decode(data)
