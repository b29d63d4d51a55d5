"""PDOs of any device: every transmission type, timer and mapping that CiA 301 knows (§7.2.2)."""

from itertools import pairwise
from pathlib import Path

import pytest

from tests.unit.hil_sim.bench import NODE, DeviceBench
from tests.unit.hil_sim.device_file import (
    BOOLEAN,
    DOMAIN,
    INTEGER24,
    REAL32,
    UNSIGNED8,
    UNSIGNED16,
    UNSIGNED32,
    UNSIGNED64,
    communication,
)

TPDO, RPDO = 0x180 + NODE, 0x200 + NODE
VALUE, OTHER = 0x2000, 0x2001
VALID, INVALID = TPDO, 0x8000_0000 | TPDO


def device(tmp_path: Path, kind: int = 255) -> DeviceBench:
    """A device whose PDOs each carry a 16-bit number."""
    file = communication()
    for index, data_type in (
        (VALUE, UNSIGNED16),
        (OTHER, UNSIGNED16),
        (0x2003, UNSIGNED64),
        (0x2004, REAL32),
        (0x2005, INTEGER24),
        (0x2006, BOOLEAN),
    ):
        file.add(index, None, data_type, 0, mapping=True)
    for index, access in (
        (0x2010, "ro"),
        (0x2011, "wo"),
        (0x2012, "rwr"),
        (0x2013, "rww"),
        (0x2014, "const"),
    ):
        file.add(index, None, UNSIGNED8, 0, access, mapping=True)
    file.add(0x2020, None, UNSIGNED8, 0, mapping=False).add(0x2021, None, DOMAIN, "00", mapping=True)
    file.pdo(0, False, "$NODEID+0x180", kind, VALUE << 16 | 16)
    file.pdo(1, False, "$NODEID+0x80000280", 255)
    file.pdo(0, True, "$NODEID+0x200", 255, OTHER << 16 | 16)
    file.pdo(1, True, "$NODEID+0x80000300", 255)
    bench = DeviceBench(file.write(tmp_path))
    bench.boot()
    return bench


def started(tmp_path: Path, kind: int = 255) -> DeviceBench:
    bench = device(tmp_path, kind)
    bench.send(0x000, "01 00")
    bench.heard.clear()
    return bench


def set_value(bench: DeviceBench, value: int) -> None:
    assert bench.write(VALUE, 0, value, 2) == "ok"
    bench.run(5)


# -- transmission types ----------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [1, 2, 240])
def test_synchronous_pdos_go_with_every_nth_sync(tmp_path: Path, kind: int) -> None:
    bench = started(tmp_path, kind)
    for count in range(1, 2 * kind + 1):
        bench.send(0x080)
        assert len(bench.of(TPDO)) == count // kind


def test_counting_syncs_begins_anew_with_each_start(tmp_path: Path) -> None:
    bench = started(tmp_path, 3)
    for command in ("80 00", "01 00"):
        bench.send(0x080)
        bench.send(0x080)
        bench.send(0x000, command)
    assert bench.of(TPDO) == []
    for _ in range(3):
        bench.send(0x080)
    assert len(bench.of(TPDO)) == 1


@pytest.mark.parametrize("kind", [254, 255])
def test_event_driven_pdos_go_with_the_start_and_with_each_change(tmp_path: Path, kind: int) -> None:
    bench = device(tmp_path, kind)
    bench.send(0x000, "01 00")
    assert bench.of(TPDO) == [b"\0\0"]
    for value in (1, 1, 2):
        set_value(bench, value)
    assert bench.of(TPDO) == [b"\0\0", b"\1\0", b"\2\0"]
    bench.send(0x080)
    assert len(bench.of(TPDO)) == 3


def test_type_252_is_sampled_with_sync_and_sent_on_request(tmp_path: Path) -> None:
    bench = started(tmp_path, 252)
    assert bench.ask(TPDO) == []  # nothing is sampled yet
    set_value(bench, 7)
    bench.send(0x080)
    set_value(bench, 8)
    assert bench.of(TPDO) == []
    assert bench.ask(TPDO) == [b"\7\0"]
    bench.send(0x080)
    assert bench.ask(TPDO) == [b"\x08\0"]


def test_type_253_is_sent_on_request_alone(tmp_path: Path) -> None:
    bench = started(tmp_path, 253)
    set_value(bench, 7)
    bench.send(0x080)
    assert bench.of(TPDO) == []
    assert bench.ask(TPDO) == [b"\7\0"]


def test_a_request_is_answered_in_operational_alone(tmp_path: Path) -> None:
    bench = device(tmp_path, 253)
    assert bench.ask(TPDO) == []
    bench.send(0x000, "01 00")
    assert len(bench.ask(TPDO)) == 1
    bench.send(0x000, "02 00")
    assert bench.ask(TPDO) == []


@pytest.mark.parametrize("kind", [241, 251])
def test_reserved_types_are_refused(tmp_path: Path, kind: int) -> None:
    bench = device(tmp_path)
    assert bench.write(0x1800, 2, kind, 1) == "06090030"
    assert bench.write(0x1400, 2, kind, 1) == "06090030"
    assert bench.write(0x1400, 2, 252, 1) == "06090030"  # nobody asks for what is received
    assert bench.write(0x1800, 2, 252, 1) == "ok"


def test_a_type_may_change_while_the_pdo_runs(tmp_path: Path) -> None:
    bench = started(tmp_path, 255)
    assert bench.write(0x1800, 2, 1, 1) == "ok"
    set_value(bench, 3)
    assert bench.of(TPDO) == []
    bench.send(0x080)
    assert bench.of(TPDO) == [b"\3\0"]


# -- times -----------------------------------------------------------------------------------------------


def times(bench: DeviceBench) -> list[float]:
    return [heard.at_ms for heard in bench.heard if heard.cob_id == TPDO]


def test_the_inhibit_time_lies_between_two_pdos_and_nothing_is_lost(tmp_path: Path) -> None:
    bench = device(tmp_path)
    bench.write(0x1800, 1, INVALID, 4)
    assert bench.write(0x1800, 3, 405, 2) == "ok"  # 40.5 ms
    bench.write(0x1800, 1, VALID, 4)
    bench.send(0x000, "01 00")
    for value in range(1, 30):
        set_value(bench, value)
    bench.run(100)
    gaps = [b - a for a, b in pairwise(times(bench))]
    assert len(gaps) >= 4
    assert all(40.4 < gap < 46 for gap in gaps)
    assert bench.of(TPDO)[-1] == b"\x1d\0"


def test_the_inhibit_time_is_fixed_while_the_pdo_is_valid(tmp_path: Path) -> None:
    bench = device(tmp_path)
    assert bench.write(0x1800, 3, 10, 2) == "08000022"
    assert bench.write(0x1800, 6, 10, 1) == "08000022"
    assert bench.write(0x1800, 5, 10, 2) == "ok"


def test_the_event_timer_counts_from_the_last_pdo(tmp_path: Path) -> None:
    bench = started(tmp_path, 254)
    assert bench.write(0x1800, 5, 50, 2) == "ok"
    bench.run(230)
    first = times(bench)
    assert [round(b - a) for a, b in pairwise(first)] == [50] * 3
    set_value(bench, 1)
    bench.run(100)
    gaps = [b - a for a, b in pairwise(times(bench))]
    assert min(gaps) < 45  # the change came in between,
    assert all(gap <= 50.5 for gap in gaps)  # and the timer begins with it


@pytest.mark.parametrize(("kind", "sent"), [(0, 0), (1, 1)])
def test_the_event_timer_does_not_concern_synchronous_pdos(tmp_path: Path, kind: int, sent: int) -> None:
    bench = started(tmp_path, kind)
    bench.write(0x1800, 5, 10, 2)
    bench.run(100)
    assert bench.of(TPDO) == []
    bench.send(0x080)
    assert len(bench.of(TPDO)) == sent


def test_an_rpdo_that_does_not_come_in_time_is_an_emergency(tmp_path: Path) -> None:
    bench = started(tmp_path)
    assert bench.write(0x1400, 5, 100, 2) == "ok"
    bench.run(200)
    assert bench.of(0x80 + NODE) == []  # watching begins with the first
    bench.send(RPDO, "01 00")
    bench.run(90)
    bench.send(RPDO, "02 00")
    bench.run(90)
    assert bench.of(0x80 + NODE) == []
    bench.run(20)
    assert [data[:2] for data in bench.of(0x80 + NODE)] == [b"\x50\x82"]
    bench.send(RPDO, "03 00")
    assert bench.of(0x80 + NODE)[1:] == [bytes(8)]


# -- SYNC counter ----------------------------------------------------------------------------------------


def test_with_a_counter_a_pdo_begins_at_its_start_value(tmp_path: Path) -> None:
    bench = device(tmp_path, 2)
    assert bench.write(0x1019, 0, 10, 1) == "ok"
    bench.write(0x1800, 1, INVALID, 4)
    assert bench.write(0x1800, 6, 4, 1) == "ok"
    bench.write(0x1800, 1, VALID, 4)
    bench.send(0x000, "01 00")
    sent = []
    for counter in (1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 1):
        before = len(bench.of(TPDO))
        bench.send(0x080, f"{counter:02X}")
        if len(bench.of(TPDO)) > before:
            sent.append(counter)
    assert sent == [4, 6, 8, 10]


def test_a_sync_of_another_length_than_1019h_says_is_an_emergency_and_no_sync(tmp_path: Path) -> None:
    bench = started(tmp_path, 1)
    bench.send(0x080, "01")
    bench.send(0x080, "02")
    assert bench.of(TPDO) == []
    assert [data[:2] for data in bench.of(0x80 + NODE)] == [b"\x40\x82"]
    bench.send(0x080)
    assert len(bench.of(TPDO)) == 1
    assert bench.of(0x80 + NODE)[1:] == [bytes(8)]


@pytest.mark.parametrize(
    ("overflow", "answer"), [(0, "ok"), (1, "06090030"), (2, "ok"), (240, "ok"), (241, "06090030")]
)
def test_counter_overflow_values(tmp_path: Path, overflow: int, answer: str) -> None:
    assert device(tmp_path).write(0x1019, 0, overflow, 1) == answer


def test_the_counter_is_fixed_while_there_is_a_cycle(tmp_path: Path) -> None:
    bench = device(tmp_path)
    bench.write(0x1006, 0, 10_000, 4)
    assert bench.write(0x1019, 0, 4, 1) == "08000022"


def test_a_device_may_produce_sync(tmp_path: Path) -> None:
    bench = device(tmp_path, 2)
    bench.write(0x1019, 0, 3, 1)
    bench.write(0x1006, 0, 10_000, 4)
    assert bench.write(0x1005, 0, 0x4000_0081, 4) == "ok"
    assert bench.write(0x1005, 0, 0x4000_0082, 4) == "06090030"  # not while it is produced
    bench.send(0x000, "01 00")
    bench.heard.clear()
    bench.run(100)
    counters = [data[0] for data in bench.of(0x081)]
    assert len(counters) in (9, 10, 11)
    assert all(after == before % 3 + 1 for before, after in pairwise(counters))
    beats = [heard.at_ms for heard in bench.heard if heard.cob_id == 0x081]
    assert [round(b - a) for a, b in pairwise(beats)] == [10] * (len(beats) - 1)
    assert len(bench.of(TPDO)) == len(beats) // 2
    bench.send(0x000, "02 00")
    bench.heard.clear()
    bench.run(100)
    assert bench.of(0x081) == []


def test_a_synchronous_pdo_after_the_window_of_1007h_waits_for_nothing(tmp_path: Path) -> None:
    file = communication().add(OTHER, None, UNSIGNED16, 0, mapping=True).add(0x1007, None, UNSIGNED32, 5000)
    file.pdo(0, True, "$NODEID+0x200", 1, OTHER << 16 | 16)
    bench = DeviceBench(file.write(tmp_path))
    bench.start()
    for late_ms, value in ((0, 0x1111), (10, 0x2222)):
        bench.send(0x080)
        bench.run(late_ms)
        bench.send(RPDO, value.to_bytes(2, "little").hex())
    bench.send(0x080)
    assert bench.read(OTHER) == 0x1111
    assert bench.write(0x1007, 0, 0, 4) == "ok"
    bench.run(50)
    bench.send(RPDO, "3333")
    bench.send(0x080)
    assert bench.read(OTHER) == 0x3333, "without a window it counts whenever it comes"


def test_the_time_of_day_is_taken_and_made_at_1012h(tmp_path: Path) -> None:
    bench = DeviceBench(communication().add(0x1012, None, UNSIGNED32, 0x8000_0100).write(tmp_path))
    bench.boot()
    bench.send(0x100, "01 00 00 00 02 00")
    bench.send(0x100, "FF 00")
    assert bench.node.time_of_day == (1, 2)
    assert bench.write(0x1012, 0, 0x8000_0123, 4) == "06090030", "not while it is taken"
    assert bench.write(0x1012, 0, 0x0000_0100, 4) == "ok"
    assert bench.write(0x1012, 0, 0x4000_0100, 4) == "ok"
    before = len(bench.of(0x100))
    bench.run(2500)
    made = [int.from_bytes(data[:4], "little") for data in bench.of(0x100)[before:]]
    assert [b - a for a, b in pairwise(made)] == [1000]
    bench.send(0x000, "02 00")
    before = len(bench.of(0x100))
    bench.run(2500)
    assert len(bench.of(0x100)) == before


# -- identifiers -----------------------------------------------------------------------------------------


def test_an_identifier_changes_while_the_pdo_is_invalid(tmp_path: Path) -> None:
    bench = started(tmp_path, 1)
    assert bench.write(0x1800, 1, 0x300, 4) == "06090030"
    assert bench.write(0x1800, 1, 0x8000_0300, 4) == "ok"
    assert bench.write(0x1800, 1, 0x300, 4) == "ok"
    bench.send(0x080)
    assert bench.of(TPDO) == []
    assert len(bench.of(0x300)) == 1


def test_two_rpdos_may_share_an_identifier(tmp_path: Path) -> None:
    bench = started(tmp_path)
    bench.write(0x1601, 1, VALUE << 16 | 16, 4)
    assert bench.write(0x1601, 0, 1, 1) == "ok"
    assert bench.write(0x1401, 1, RPDO, 4) == "ok"
    bench.send(RPDO, "34 12")
    assert bench.read(VALUE) == bench.read(OTHER) == 0x1234


def test_sync_may_have_another_identifier(tmp_path: Path) -> None:
    bench = started(tmp_path, 1)
    assert bench.write(0x1005, 0, 0x85, 4) == "ok"
    bench.send(0x080)
    assert bench.of(TPDO) == []
    bench.send(0x085)
    assert len(bench.of(TPDO)) == 1
    assert bench.write(0x1005, 0, 0x180, 4) == "06090030"


# -- mapping ---------------------------------------------------------------------------------------------


def remap(bench: DeviceBench, received: bool, *mapped: int) -> str:
    """Map the second PDO of a direction by the proper sequence; the answer to the first thing refused."""
    mapping = 0x1601 if received else 0x1A01
    for subindex, value, size in ((0, 0, 1), *((place, value, 4) for place, value in enumerate(mapped, 1))):
        answer = bench.write(mapping, subindex, value, size)
        if answer != "ok":
            return answer
    return bench.write(mapping, 0, len(mapped), 1)


@pytest.mark.parametrize(
    ("mapped", "sent", "received"),
    [
        (0x2010_0008, "ok", "06040041"),  # ro
        (0x2011_0008, "06040041", "ok"),  # wo
        (0x2012_0008, "ok", "06040041"),  # rwr
        (0x2013_0008, "06040041", "ok"),  # rww
        (0x2014_0008, "ok", "06040041"),  # const
        (0x2000_0010, "ok", "ok"),
        (0x2000_0008, "06040041", "06040041"),  # another length than the object has
        (0x2005_0018, "ok", "ok"),
        (0x2006_0001, "ok", "ok"),
        (0x2020_0008, "06040041", "06040041"),  # not mappable
        (0x2021_0008, "06040041", "06040041"),  # a domain
        (0x2FFF_0008, "06020000", "06020000"),
        (0x2000_0110, "06020000", "06020000"),
        (0x0005_0008, "06040041", "ok"),  # a dummy only takes room in what is received
        (0x0001_0001, "06040041", "06040041"),  # a dummy that [DummyUsage] does not allow
        (0x0005_0010, "06040041", "06040041"),
    ],
)
def test_what_may_be_mapped(tmp_path: Path, mapped: int, sent: str, received: str) -> None:
    bench = device(tmp_path)
    assert remap(bench, False, mapped) == sent
    assert remap(bench, True, mapped) == received


def test_sixty_four_bits_is_the_most(tmp_path: Path) -> None:
    bench = device(tmp_path)
    assert remap(bench, False, 0x2003_0040) == "ok"
    assert remap(bench, False, 0x2003_0040, 0x2006_0001) == "06040042"
    assert remap(bench, False, *([0x2010_0008] * 8)) == "ok"
    assert bench.write(0x1A01, 0, 0, 1) == "ok"
    assert bench.write(0x1A01, 0, 9, 1) == "06040042"


def test_an_empty_place_is_not_mapped(tmp_path: Path) -> None:
    bench = device(tmp_path)
    assert bench.write(0x1A01, 0, 1, 1) == "06040041"


def test_values_stand_in_the_order_of_the_mapping(tmp_path: Path) -> None:
    bench = device(tmp_path)
    bench.write(VALUE, 0, 0x1122, 2)
    bench.sdo("21 05 20 00 03 00 00 00")
    bench.sdo("09 FE FF FF 00 00 00 00")
    assert remap(bench, False, 0x2006_0001, VALUE << 16 | 16, 0x2005_0018) == "ok"
    bench.write(0x2006, 0, 1, 1)
    assert bench.write(0x1801, 1, 0x280 + NODE, 4) == "ok"
    bench.send(0x000, "01 00")
    packed = 1 | 0x1122 << 1 | 0xFFFFFE << 17
    assert bench.of(0x280 + NODE) == [packed.to_bytes(6, "little")]


def test_dummies_take_room_and_are_not_written(tmp_path: Path) -> None:
    bench = started(tmp_path)
    assert remap(bench, True, 0x0005_0008, VALUE << 16 | 16, 0x0007_0020, 0x2013_0008) == "ok"
    assert bench.write(0x1401, 1, 0x300 + NODE, 4) == "ok"
    bench.send(0x300 + NODE, "FF 34 12 FF FF FF FF 05")
    assert bench.read(VALUE) == 0x1234
    assert bench.read(0x2013) == 5
    assert bench.sdo("40 05 00 00 00 00 00 00") == "80 05 00 00 00 00 02 06"


def test_a_pdo_without_objects_is_not_sent(tmp_path: Path) -> None:
    bench = device(tmp_path)
    assert bench.write(0x1801, 1, 0x280 + NODE, 4) == "ok"
    bench.send(0x000, "01 00")
    bench.send(0x080)
    assert bench.of(0x280 + NODE) == []


def test_configuring_one_pdo_leaves_the_others_alone(tmp_path: Path) -> None:
    bench = started(tmp_path, 2)
    bench.send(0x080)
    assert remap(bench, False, VALUE << 16 | 16) == "ok"
    assert bench.write(0x1801, 1, 0x280 + NODE, 4) == "ok"
    assert len(bench.of(0x280 + NODE)) == 1
    bench.send(0x080)
    assert len(bench.of(TPDO)) == 1
