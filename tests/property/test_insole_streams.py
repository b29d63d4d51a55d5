"""Insole streams with garbage in them: what was sent whole arrives, nothing else does."""

from hypothesis import given
from hypothesis import strategies as st

from drivers.insole.formats.insole_cobs import InsoleCobsParser
from tests.unit.insole.encode import CALIBRATED, RIGHT, cobs_frame
from tests.unit.port.streams import parse

counts = st.lists(st.integers(0, 0xFFFF), min_size=1, max_size=64)


@given(counts, st.integers(0, 0xFFFF), st.integers(0, 0xFFFFFFFF), st.sampled_from([0, RIGHT, CALIBRATED]))
def test_what_is_encoded_is_decoded(cells: list[int], sequence: int, time_us: int, flags: int) -> None:
    (frame,) = parse(InsoleCobsParser, cobs_frame(cells, flags=flags, sequence=sequence, time_us=time_us))
    scale = 100.0 if flags & CALIBRATED else 1.0
    assert frame.cells == tuple(count * scale for count in cells)
    assert (frame.sequence, frame.ticks) == (sequence, time_us)
    assert frame.foot == ("right" if flags & RIGHT else "left")


@given(st.lists(st.tuples(st.binary(max_size=300), counts), min_size=1, max_size=6), st.data())
def test_garbage_between_frames_costs_at_most_the_frame_it_touches(
    parts: list[tuple[bytes, list[int]]], data: st.DataObject
) -> None:
    # A delimiter behind the garbage ends it; every frame must then arrive.
    stream = b"".join(
        garbage + b"\0" + cobs_frame(cells, sequence=index) for index, (garbage, cells) in enumerate(parts)
    )
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=8)))
    chunks = [stream[a:b] for a, b in zip([0, *cuts], [*cuts, len(stream)], strict=True)]
    parser = InsoleCobsParser()
    frames = [frame for chunk in chunks for frame in parser.feed(chunk)]
    assert [frame.sequence for frame in frames] == list(range(len(parts)))
    assert [frame.cells for frame in frames] == [
        tuple(count * 100.0 for count in cells) for _, cells in parts
    ]
    assert parser.counters.bytes_dropped == sum(len(garbage.replace(b"\0", b"")) for garbage, _ in parts), (
        "all garbage but its delimiters"
    )
