"""An SDO conversation heard from outside is whole, or told to be not: expedited, segmented, in blocks."""

import pytest

from drivers.trace.sdo import Conversation, SdoText

OBJECT = (0x1008, 0)


def told(conversation: Conversation, *frames: str) -> list[SdoText]:
    """Frames in hexadecimal; `>` those of the client, `<` those of the server."""
    return [
        (conversation.request if frame[0] == ">" else conversation.response)(bytes.fromhex(frame[1:]))
        for frame in frames
    ]


def values(said: list[SdoText]) -> list[bytes]:
    """What was carried by transfers that are over."""
    return [one.value for one in said if one.done and one.value is not None]


EXPEDITED = ("> 40 41 60 00 00 00 00 00", "< 4B 41 60 00 37 02 00 00")
WRITTEN = ("> 2B 72 60 00 F4 01 00 00", "< 60 72 60 00 00 00 00 00")
SEGMENTED = (
    "> 40 08 10 00 00 00 00 00",
    "< 41 08 10 00 0A 00 00 00",
    "> 60 00 00 00 00 00 00 00",
    "< 00 41 42 43 44 45 46 47",
    "> 70 00 00 00 00 00 00 00",
    "< 19 48 49 4A 00 00 00 00",
)
SEGMENTS_WRITTEN = (
    "> 21 08 10 00 09 00 00 00",
    "< 60 08 10 00 00 00 00 00",
    "> 00 41 42 43 44 45 46 47",
    "< 20 00 00 00 00 00 00 00",
    "> 1B 48 49 00 00 00 00 00",
    "< 30 00 00 00 00 00 00 00",
)
BLOCKS_READ = (
    "> A4 08 10 00 02 00 00 00",
    "< C6 08 10 00 12 00 00 00",
    "> A3 00 00 00 00 00 00 00",
    "< 01 41 42 43 44 45 46 47",
    "< 02 48 49 4A 4B 4C 4D 4E",
    "> A2 02 02 00 00 00 00 00",
    "< 81 4F 50 51 52 00 00 00",
    "> A2 01 02 00 00 00 00 00",
    "< CD 00 00 00 00 00 00 00",
    "> A1 00 00 00 00 00 00 00",
)
BLOCKS_WRITTEN = (
    "> C6 08 10 00 09 00 00 00",
    "< A4 08 10 00 7F 00 00 00",
    "> 01 41 42 43 44 45 46 47",
    "> 82 48 49 00 00 00 00 00",
    "< A2 02 7F 00 00 00 00 00",
    "> D5 00 00 00 00 00 00 00",
    "< A1 00 00 00 00 00 00 00",
)
RESENT = (  # the server has lost the second segment of three
    *BLOCKS_WRITTEN[:2],
    "> 01 41 42 43 44 45 46 47",
    "> 02 00 00 00 00 00 00 00",
    "> 83 00 00 00 00 00 00 00",
    "< A2 01 7F 00 00 00 00 00",
    "> 81 48 49 00 00 00 00 00",
    "< A2 01 7F 00 00 00 00 00",
    *BLOCKS_WRITTEN[5:],
)


@pytest.mark.parametrize(
    ("frames", "about", "value", "is_write"),
    [
        (EXPEDITED, (0x6041, 0), b"\x37\x02", False),
        (WRITTEN, (0x6072, 0), b"\xf4\x01", True),
        (SEGMENTED, OBJECT, b"ABCDEFGHIJ", False),
        (SEGMENTS_WRITTEN, OBJECT, b"ABCDEFGHI", True),
        (BLOCKS_READ, OBJECT, b"ABCDEFGHIJKLMNOPQR", False),
        (BLOCKS_WRITTEN, OBJECT, b"ABCDEFGHI", True),
        (RESENT, OBJECT, b"ABCDEFGHI", True),
    ],
)
def test_a_transfer_has_one_value_when_it_is_over(
    frames: tuple[str, ...], about: tuple[int, int], value: bytes, is_write: bool
) -> None:
    said = told(Conversation(), *frames)
    assert values(said) == [value]
    assert (said[-1].object, said[-1].done, said[-1].is_write) == (about, True, is_write)
    assert all(one.object == about for one in said)


def test_the_size_of_an_expedited_transfer_may_be_untold() -> None:
    assert values(told(Conversation(), "< 42 00 20 00 01 02 03 04")) == [b"\x01\x02\x03\x04"]


@pytest.mark.parametrize("frames", [SEGMENTED, SEGMENTS_WRITTEN, BLOCKS_READ, BLOCKS_WRITTEN])
def test_an_abort_ends_a_transfer_wherever_it_comes_and_the_next_one_is_whole(
    frames: tuple[str, ...],
) -> None:
    for place in range(1, len(frames)):
        conversation = Conversation()
        told(conversation, *frames[:place])
        (said,) = told(conversation, "> 80 08 10 00 00 00 04 05")
        assert "timed out (abort 0x05040000)" in said.words
        assert values(told(conversation, *EXPEDITED)) == [b"\x37\x02"]


@pytest.mark.parametrize("frames", [SEGMENTED, SEGMENTS_WRITTEN, BLOCKS_READ, BLOCKS_WRITTEN, WRITTEN])
def test_a_frame_that_was_not_heard_makes_no_value_up(frames: tuple[str, ...]) -> None:
    whole = values(told(Conversation(), *frames))
    for place in range(len(frames)):
        late = values(told(Conversation(), *frames[place:]))
        with_a_gap = values(told(Conversation(), *frames[:place], *frames[place + 1 :]))
        assert late in ([], whole)
        assert with_a_gap in ([], whole), f"without {frames[place]}"


def test_a_write_that_is_refused_has_changed_nothing() -> None:
    said = told(Conversation(), WRITTEN[0], "< 80 72 60 00 31 00 09 06")
    assert values(said) == []
    assert said[1].words == "abort {}: the value is too high (abort 0x06090031)"


@pytest.mark.parametrize("frame", ["> E0 00 00 00 00 00 00 00", "< FF 00 00 00 00 00 00 00", "> 40 00", "<"])
def test_what_is_no_sdo_is_said(frame: str) -> None:
    (said,) = told(Conversation(), frame)
    assert said.words.startswith("no SDO")
