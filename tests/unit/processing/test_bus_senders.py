"""Who sends on a bus: nodes have what they send themselves, and all frames have a name."""

import pytest
from msgspec.structs import replace

from gateway.wire.bus import BusInfo, NodeInfo, TalkInfo
from server_gui.core.processing.bus_health import trouble
from server_gui.core.processing.bus_senders import NOBODY, REST, fewer, kinds, talking, total, whole_numbers

NODE = NodeInfo(2, ["left_knee"], 0.44, 12.0, 88, 0, 0, 0.0)
TALKS = [
    TalkInfo("TPDO", 2, 900.0),
    TalkInfo("RPDO", 2, 100.0),
    TalkInfo("SYNC", None, 100.0),
    TalkInfo("heartbeat", 2, 10.0),
]
BUS = BusInfo("main", "error active", 1_000_000, 24.0, 1250.0, 0, 0, 1, 0, [NODE], None, [], TALKS)


def test_a_node_has_what_it_sends_and_not_what_is_sent_to_it() -> None:
    knee, *others = talking(BUS)
    assert (knee.node_id, knee.names, knee.frames_per_s) == (2, ("left_knee",), 910.0)
    assert knee.kinds == (("TPDO", 900.0), ("heartbeat", 10.0))
    assert {one.name: one.frames_per_s for one in others} == {"RPDO": 100.0, "SYNC": 100.0, REST: 140.0}


@pytest.mark.parametrize("told", [1250.0, 1110.4, 1110.0, 900.0, None])
def test_kinds_and_senders_add_up_to_all_frames_of_the_bus(told: float | None) -> None:
    """Also the frames that the gateway sends itself, which it does not receive: its SDO requests."""
    bus = replace(BUS, frames_per_s=told)
    whole = total(bus)
    assert whole == (1250.0 if told == 1250.0 else 1110.0)
    assert sum(rate for _, rate in kinds(bus)) == pytest.approx(whole)
    assert sum(one.frames_per_s for one in talking(bus)) == pytest.approx(whole)
    assert sum(one.share for one in talking(bus)) == pytest.approx(1.0)


def test_where_nothing_is_known_of_the_senders_none_is_made_up() -> None:
    silent = replace(BUS, talks=[])
    assert talking(silent) == []
    assert kinds(silent) == []
    assert total(silent) == 1250.0
    assert total(replace(silent, frames_per_s=None)) is None


def test_shown_numbers_add_up_to_the_shown_total() -> None:
    assert whole_numbers([0.4, 0.4, 0.4, 1.3], 2.5) == [1, 0, 0, 1]
    rates = [374.5, 378.5, 378.5, 377.4, 112.3]
    assert sum(whole_numbers(rates, sum(rates))) == round(sum(rates))


def test_sync_is_named_and_is_no_frame_of_an_unknown_node() -> None:
    assert NOBODY not in {one.name for one in talking(BUS)}
    assert {one.name for one in talking(replace(BUS, talks=[*TALKS, TalkInfo("other", None, 1.0)]))} >= {
        NOBODY,
        "SYNC",
    }


def test_the_remedy_of_a_full_bus_names_its_largest_sender() -> None:
    said = trouble(replace(BUS, load_percent=92.0))
    assert said is not None
    assert said[1].startswith("73 % of its frames are from left knee, the most: ")
    flooded = replace(
        BUS, load_percent=92.0, frames_per_s=8065.0, talks=[*TALKS, TalkInfo("other", None, 5644.0)]
    )
    assert fewer(flooded).startswith("70 % of its frames are from no known node: ")
    assert "gwrms trace" in fewer(flooded)
    assert fewer(replace(BUS, talks=[])).startswith("find what sends so much")
