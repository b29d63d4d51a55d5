"""SDO transfers, byte by byte as CiA 301 §7.2.4 draws them."""

from collections.abc import Generator, Sequence
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.bus.sdo import protocol

Steps = Generator[bytes, bytes, Any]


def play(steps: Steps, dialogue: Sequence[tuple[str, str]]) -> object:
    """Send each response after checking the request before it; returns the transfer's result."""
    request = next(steps)
    for expected, response in dialogue:
        assert request == bytes.fromhex(expected)
        try:
            request = steps.send(bytes.fromhex(response))
        except StopIteration as done:
            return done.value
    raise AssertionError(f"not done: {request!r}")


@pytest.mark.parametrize(
    ("response", "data"),
    [
        ("43 64 60 00 78 56 34 12", "78 56 34 12"),
        ("47 64 60 00 78 56 34 00", "78 56 34"),
        ("4B 64 60 00 78 56 00 00", "78 56"),
        ("4F 64 60 00 78 00 00 00", "78"),
        ("42 64 60 00 78 56 34 12", "78 56 34 12"),  # size not told: all four
    ],
)
def test_expedited_upload(response: str, data: str) -> None:
    dialogue = [("40 64 60 00 00 00 00 00", response)]
    assert play(protocol.upload(0x6064, 0), dialogue) == bytes.fromhex(data)


def test_segmented_upload() -> None:
    assert (
        play(
            protocol.upload(0x1008, 0),
            [
                ("40 08 10 00 00 00 00 00", "41 08 10 00 0A 00 00 00"),
                ("60 00 00 00 00 00 00 00", "00 41 42 43 44 45 46 47"),
                ("70 00 00 00 00 00 00 00", "19 48 49 4A 00 00 00 00"),
            ],
        )
        == b"ABCDEFGHIJ"
    )


@pytest.mark.parametrize(
    ("data", "request_hex"),
    [
        ("02 00", "2B 40 60 00 02 00 00 00"),
        ("01", "2F 40 60 00 01 00 00 00"),
        ("01 02 03", "27 40 60 00 01 02 03 00"),
        ("73 61 76 65", "23 40 60 00 73 61 76 65"),
    ],
)
def test_expedited_download(data: str, request_hex: str) -> None:
    steps = protocol.download(0x6040, 0, bytes.fromhex(data))
    assert play(steps, [(request_hex, "60 40 60 00 00 00 00 00")]) is None


def test_segmented_download() -> None:
    dialogue = [
        ("21 08 10 00 0A 00 00 00", "60 08 10 00 00 00 00 00"),
        ("00 41 42 43 44 45 46 47", "20 00 00 00 00 00 00 00"),
        ("19 48 49 4A 00 00 00 00", "30 00 00 00 00 00 00 00"),
    ]
    assert play(protocol.download(0x1008, 0, b"ABCDEFGHIJ"), dialogue) is None


def test_an_abort_ends_the_transfer_with_its_code() -> None:
    steps = protocol.upload(0x6064, 0)
    with pytest.raises(protocol.SdoAborted) as caught:
        play(steps, [("40 64 60 00 00 00 00 00", "80 64 60 00 00 00 02 06")])
    assert caught.value.abort_code == 0x06020000


READ, WRITE, BEGIN_WRITE = "40 64 60 00", "2B 64 60 00 02 00", "21 64 60 00 0A"
READ_SEGMENT, READ_SEGMENT_TOGGLED, WRITE_SEGMENT, WRITE_SEGMENT_TOGGLED = "60", "70", "00 41 42", "19 48"


def frame(text: str) -> bytes:
    return bytes.fromhex(text).ljust(8, b"\0")


@pytest.mark.parametrize(
    ("request_hex", "response", "belongs"),
    [
        (READ, "4B 64 60 00 27 06", True),
        (READ, "41 64 60 00 0A", True),
        (READ, "80 64 60 00 00 00 02 06", True),
        (READ, "4B 41 60 00 27 06", False),  # another object
        (READ, "4B 64 60 01 27 06", False),  # another sub-index
        (READ, "60 64 60 00", False),  # the confirmation of a write
        (READ, "80 41 60 00 00 00 02 06", False),  # the abort of another object
        (READ, "00 64 60 00", False),  # a segment, whose data look like the object
        (WRITE, "60 64 60 00", True),
        (WRITE, "60 65 60 00", False),
        (WRITE, "43 64 60 00", False),
        (WRITE, "20 64 60 00", False),
        (BEGIN_WRITE, "60 64 60 00", True),
        (READ_SEGMENT, "00 41 42 43", True),
        (READ_SEGMENT, "19 41 42 43", False),  # repeats the segment before
        (READ_SEGMENT_TOGGLED, "19 41 42 43", True),
        (READ_SEGMENT, "20", False),
        (READ_SEGMENT, "80 64 60 00", True),
        (READ_SEGMENT, "43 64 60 00", False),
        (WRITE_SEGMENT, "20", True),
        (WRITE_SEGMENT, "30", False),
        (WRITE_SEGMENT_TOGGLED, "30", True),
        (WRITE_SEGMENT, "60 64 60 00", False),
    ],
)
def test_which_response_can_be_the_one_to_a_request(request_hex: str, response: str, belongs: bool) -> None:
    about = protocol.multiplexer(0x6064, 0)
    assert protocol.answers(frame(response), frame(request_hex), about) is belongs


def test_a_device_that_sends_less_than_it_announced_is_not_believed() -> None:
    dialogue = [
        ("40 08 10 00 00 00 00 00", "41 08 10 00 0A 00 00 00"),
        ("60 00 00 00 00 00 00 00", "01 41 42 43 44 45 46 47"),
    ]
    with pytest.raises(protocol.SdoProtocolError, match="announced 10 bytes and sent 7"):
        play(protocol.upload(0x1008, 0), dialogue)


def test_an_upload_without_end_is_bounded() -> None:
    steps = protocol.upload(0x1008, 0)
    next(steps)
    with pytest.raises(protocol.SdoProtocolError, match="announces"):
        steps.send(bytes.fromhex("41 08 10 00 FF FF FF FF"))


def test_nothing_to_write_is_refused() -> None:
    with pytest.raises(ValueError, match="nothing to write"):
        next(protocol.download(0x6040, 0, b""))


def test_an_abort_request_names_object_and_code() -> None:
    assert protocol.abort_request(0x6064, 2, 0x05040000) == bytes.fromhex("80 64 60 02 00 00 04 05")


@given(st.binary(min_size=1, max_size=300))
def test_what_is_downloaded_in_segments_is_what_the_device_gets(data: bytes) -> None:
    steps = protocol.download(0x2000, 1, data)
    request = next(steps)
    received = bytearray()
    try:
        while True:
            if request[0] & 0xE0 == 0x20:
                if request[0] & 2:
                    received += request[4 : 8 - (request[0] >> 2 & 3)]
                request = steps.send(b"\x60\x00\x20\x01" + bytes(4))
            else:
                received += request[1 : 8 - (request[0] >> 1 & 7)]
                request = steps.send(bytes([0x20 | request[0] & 0x10]) + bytes(7))
    except StopIteration:
        assert bytes(received) == data


@given(st.lists(st.binary(min_size=8, max_size=8), max_size=12))
def test_garbage_never_breaks_a_transfer_otherwise_than_it_says(responses: list[bytes]) -> None:
    for steps in (protocol.upload(0x6064, 0), protocol.download(0x2000, 1, bytes(20))):
        try:
            next(steps)
            for response in responses:
                steps.send(response)
        except (StopIteration, protocol.SdoAborted, protocol.SdoProtocolError):
            continue
