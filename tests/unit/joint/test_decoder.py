"""TPDO bytes to values, on whole bytes and across them."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.bus.fields import Field, Linear
from drivers.bus.pdo import MappedObject, Tpdo
from drivers.joint.cia402 import DriveState
from drivers.joint.decoder import make_decoder

STATUSWORD, STATE = 0, 9
PLAIN = Linear(1)


def tpdo(*bits: int) -> Tpdo:
    at, objects = 0, []
    for number, width in enumerate(bits):
        objects.append(MappedObject(0x2000 + number, 0, width, at))
        at += width
    return Tpdo(1, 0x181, False, True, 1, 0, tuple(objects))


def test_statusword_and_position_with_the_state_made_of_it() -> None:
    fields = [
        Field(STATUSWORD, 0, 16, kind="unsigned", linear=PLAIN),
        Field(1, 16, 32, kind="signed", linear=Linear(0.5, 1)),
    ]
    decoder = make_decoder(tpdo(16, 32), fields, STATUSWORD, STATE)
    assert decoder.channels == (STATUSWORD, 1, STATE)
    assert decoder.size == 6
    assert decoder.values(bytes.fromhex("37 16 FE FF FF FF")) == (0x1637, 0.0, DriveState.OPERATION_ENABLED)


def test_a_statusword_without_a_known_state_has_none() -> None:
    decoder = make_decoder(
        tpdo(16), [Field(STATUSWORD, 0, 16, kind="unsigned", linear=PLAIN)], STATUSWORD, STATE
    )
    assert decoder.values(b"\x01\x00") == (1, None)


def test_objects_between_the_wanted_ones_are_skipped() -> None:
    fields = [Field(1, 8, 16, kind="signed", linear=PLAIN), Field(2, 40, 8, kind="unsigned", linear=PLAIN)]
    decoder = make_decoder(tpdo(8, 16, 16, 8), fields, STATUSWORD, STATE)
    assert decoder.values(bytes.fromhex("AA FE FF BB BB 07")) == (-2, 7)


fields_of = st.lists(
    st.tuples(st.sampled_from([8, 12, 16, 24, 32, 1, 5]), st.booleans()), min_size=1, max_size=6
).filter(lambda parts: sum(bits for bits, _ in parts) <= 64)


@given(fields_of, st.data())
def test_what_is_packed_is_what_is_decoded(parts: list[tuple[int, bool]], data: st.DataObject) -> None:
    frame, at, fields, expected = 0, 0, [], []
    for channel, (bits, signed) in enumerate(parts, start=1):
        low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)
        number = data.draw(st.integers(low, high))
        frame |= (number & (1 << bits) - 1) << at
        fields.append(Field(channel, at, bits, "signed" if signed else "unsigned", PLAIN))
        expected.append(number)
        at += bits
    decoder = make_decoder(tpdo(*(bits for bits, _ in parts)), fields, STATUSWORD, STATE)
    assert decoder.values(frame.to_bytes(8, "little")) == tuple(expected)
    assert decoder.values(frame.to_bytes(8, "little")[: decoder.size]) == tuple(expected)


@pytest.mark.parametrize("order", [(1, 0), (0, 1)])
def test_fields_may_stand_in_any_order(order: tuple[int, int]) -> None:
    parts = [Field(1, 0, 16, kind="unsigned", linear=PLAIN), Field(2, 16, 16, kind="unsigned", linear=PLAIN)]
    decoder = make_decoder(tpdo(16, 16), [parts[at] for at in order], STATUSWORD, STATE)
    values = dict(zip(decoder.channels, decoder.values(b"\x01\x00\x02\x00"), strict=True))
    assert values == {1: 1, 2: 2}


def test_what_is_left_out_between_two_objects_need_not_be_whole_bytes() -> None:
    fields = [Field(1, 0, 8, kind="unsigned", linear=PLAIN), Field(2, 12, 16, kind="signed", linear=PLAIN)]
    decoder = make_decoder(tpdo(8, 4, 16), fields, STATUSWORD, STATE)
    assert decoder.values(bytes.fromhex("AA EF FF 0F")) == (0xAA, -2)
