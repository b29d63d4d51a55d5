"""IMU streams with garbage in them: what was sent whole arrives, wherever the stream is cut."""

from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.imu.formats.witmotion import WitmotionParser
from tests.support.examples import examples
from tests.unit.imu.encode import witmotion

word = st.integers(-32768, 32767)
garbage = st.binary(max_size=60).map(lambda raw: raw.replace(b"\x55", b"\x54"))


@settings(max_examples=examples(40))
@given(st.lists(st.tuples(garbage, word, word, word), min_size=1, max_size=8), st.data())
def test_witmotion_frames_survive_garbage_and_cuts(
    parts: list[tuple[bytes, int, int, int]], data: st.DataObject
) -> None:
    stream = b"".join(noise + witmotion(0x54, a, b, c, 0) for noise, a, b, c in parts)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=8)))
    parser = WitmotionParser()
    frames = [
        frame
        for begin, end in zip([0, *cuts], [*cuts, len(stream)], strict=True)
        for frame in parser.feed(stream[begin:end])
    ]
    got = [tuple(frame.more[f"magnetic_raw_{axis}"] for axis in "xyz") for frame in frames]
    assert got == [(a, b, c) for _, a, b, c in parts]
    assert parser.counters.bytes_dropped == sum(len(noise) for noise, *_ in parts)
