"""What every parser of a byte stream is asked: any split, any damaged byte, any garbage in between."""

from collections.abc import Callable, Sequence
from typing import TypeVar

from drivers.parsing import Parser

F = TypeVar("F")
Make = Callable[[], Parser[F]]


def parse(make: Make[F], *chunks: bytes) -> list[F]:
    """The frames of `chunks`, fed one after the other to a new parser."""
    parser = make()
    frames = [frame for chunk in chunks for frame in parser.feed(chunk)]
    return frames + parser.finish()


def assert_same_at_every_split(make: Make[F], stream: bytes, expected: Sequence[F]) -> None:
    """The frames must not depend on where the stream is cut."""
    for cut in range(len(stream) + 1):
        assert parse(make, stream[:cut], stream[cut:]) == list(expected), f"split at {cut}"
    assert parse(make, *(stream[at : at + 1] for at in range(len(stream)))) == list(expected), "byte by byte"


def assert_damage_is_contained(make: Make[F], frames: Sequence[bytes], damaged: int) -> None:
    """Change every byte of frame `damaged` to a ninth of all values: nothing wrong, and at most two lost.

    The frames before it must all be there, and all from the second behind it; what is given must be what
    was sent.
    """
    sent = parse(make, *frames)
    assert len(sent) == len(frames)
    for at in range(len(frames[damaged])):
        for flip in range(1 + at % 9, 256, 9):
            raw = bytearray(frames[damaged])
            raw[at] ^= flip
            got = parse(make, *frames[:damaged], bytes(raw), *frames[damaged + 1 :])
            where = f"byte {at} ^ {flip:#04x}"
            assert all(_known(frame, sent) for frame in got), f"{where}: a frame that was not sent"
            assert got[:damaged] == sent[:damaged], where
            after = len(frames) - damaged - 2
            assert got[-after:] == sent[-after:], f"{where}: not in step again after two frames"


def _known(frame: object, sent: Sequence[object]) -> bool:
    return frame in sent
