"""Who talks on a bus is told by CiA 301's pre-defined connection set, a second at a time."""

import pytest

from drivers.bus.frames import ERROR, EXTENDED, REMOTE
from drivers.bus.traffic import NAMED, Talk, Traffic, kind_of, talks
from gateway.wire import bus as wire

SECOND_NS = 1_000_000_000


@pytest.mark.parametrize(
    ("can_id", "kind", "node_id"),
    [
        (0x000, "NMT", None),
        (0x080, "SYNC", None),
        (0x085, "EMCY", 5),
        (0x100, "time", None),
        (0x182, "TPDO", 2),
        (0x202, "RPDO", 2),
        (0x4FF, "TPDO", 127),
        (0x57F, "RPDO", 127),
        (0x583, "SDO answer", 3),
        (0x603, "SDO request", 3),
        (0x704, "heartbeat", 4),
        (0x7E4, "LSS", None),
        (0x7E5, "LSS", None),
        (0x7F0, "other", None),
        (0x005, "other", None),
        (0x123, "other", None),
        (0x1234567, "other", None),
    ],
)
def test_an_id_says_what_it_is_and_whose(can_id: int, kind: str, node_id: int | None) -> None:
    assert kind_of(can_id) == (kind, node_id)


def test_frames_are_told_by_the_second_and_errors_are_none() -> None:
    traffic = Traffic()
    traffic.look(0)
    for _ in range(50):
        traffic.take([(1, 0x182, b""), (2, 0x282, b""), (3, 0x80, b""), (4, ERROR | 1, b"")])
    traffic.look(SECOND_NS // 2)
    assert not traffic.talks, "its second is not over"
    traffic.look(2 * SECOND_NS)
    assert list(traffic.talks) == [
        Talk("TPDO", 2, 50.0, (0x182, 0x282)),
        Talk("SYNC", None, 25.0, (0x080,)),
    ]
    traffic.look(3 * SECOND_NS)
    assert not traffic.talks, "nothing came"


def test_what_fills_a_bus_is_told_by_its_identifiers_the_most_frequent_first() -> None:
    counts = [(0x001, 10), (0x7F0, 900), (EXTENDED | 0x123, 40), *((0x7F0 + n, 2) for n in range(1, 9))]
    (talk,) = talks(counts, 1.0)
    assert (EXTENDED, REMOTE) == (wire.EXTENDED, wire.REMOTE), "drivers and wire mean the same"
    assert talk.identifiers[:3] == (0x7F0, EXTENDED | 0x123, 0x001)
    assert len(talk.identifiers) == NAMED
