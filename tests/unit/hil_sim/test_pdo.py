"""PDOs: what they carry, when they go, how they are changed (CiA 301 §7.2.2)."""

import struct
from itertools import pairwise

from tests.unit.hil_sim.bench import NODE, Bench

TPDO1, TPDO2, TPDO3, TPDO4 = (base + NODE for base in (0x180, 0x280, 0x380, 0x480))
RPDO1 = 0x200 + NODE


def test_nothing_before_the_node_is_started(bench: Bench) -> None:
    bench.boot()
    bench.send(0x080)
    assert bench.of(TPDO1) == []


def test_synchronous_pdos_follow_each_sync_and_each_tenth() -> None:
    bench = Bench(position=0.5)
    bench.start()
    for _ in range(20):
        bench.send(0x080)
    assert len(bench.of(TPDO1)) == len(bench.of(TPDO2)) == 20
    assert len(bench.of(TPDO3)) == 2
    statusword, position = struct.unpack("<Hi", bench.of(TPDO1)[-1])
    assert statusword & 0x4F == 0x40
    assert position == bench.read(0x6064, signed=True) == round(0.5 * 409_600 / 6.283185307)
    assert len(bench.of(TPDO2)[-1]) == 8
    _, temperature, mode = struct.unpack("<ihb", bench.of(TPDO3)[-1])
    assert (temperature, mode) == (250, 8)


def test_a_synchronous_rpdo_takes_effect_with_the_next_sync(bench: Bench) -> None:
    bench.start()
    bench.send(RPDO1, "06 00 08 00 00 00 00")
    assert bench.read(0x6040) == 0
    bench.send(0x080)
    assert bench.read(0x6040) == 0x06
    assert bench.read(0x6041) & 0x6F == 0x21


def test_an_asynchronous_rpdo_takes_effect_at_once(bench: Bench) -> None:
    bench.start()
    assert bench.write(0x1401, 1, 0x300 + NODE, 4) == "ok"
    bench.run(1)
    bench.send(0x300 + NODE, "06 00")
    assert bench.read(0x6041) & 0x6F == 0x21


def test_an_rpdo_that_is_too_short_is_an_emergency_until_a_good_one_comes(bench: Bench) -> None:
    bench.start()
    bench.send(RPDO1, "06 00")
    bench.send(RPDO1, "06 00")
    bench.send(0x080)
    assert bench.of(0x80 + NODE) == [bytes.fromhex("10 82 11 01 00 00 00 00")]
    assert bench.read(0x6040) == 0
    bench.send(RPDO1, "06 00 08 00 00 00 00")
    assert bench.of(0x80 + NODE)[1:] == [bytes(8)]
    assert bench.read(0x1001) == 0


def test_an_rpdo_that_is_too_long_is_used_and_an_emergency(bench: Bench) -> None:
    bench.start()
    bench.send(RPDO1, "06 00 08 00 00 00 00 55")
    bench.send(0x080)
    assert bench.of(0x80 + NODE) == [bytes.fromhex("20 82 11 01 00 00 00 00")]
    assert bench.read(0x6041) & 0x6F == 0x21


def test_what_an_rpdo_brought_is_forgotten_when_the_node_leaves_operation(bench: Bench) -> None:
    bench.start()
    bench.send(RPDO1, "06 00 08 00 00 00 00")
    bench.send(0x000, "80 00")
    bench.send(0x000, "01 00")
    bench.send(0x080)
    assert bench.read(0x6040) == 0


def test_an_event_driven_pdo_goes_on_change_within_its_inhibit_time_and_on_its_timer(bench: Bench) -> None:
    bench.start()
    bench.write(0x1803, 3, 1000, 2)  # inhibit time 100 ms
    bench.write(0x1803, 5, 300, 2)  # event timer
    assert bench.write(0x1803, 1, 0x4000_0000 | TPDO4, 4) == "ok"
    bench.run(150)
    bench.heard.clear()
    bench.write(0x6040, 0, 0x06, 2)
    assert len(bench.of(TPDO4)) == 1
    bench.write(0x6040, 0, 0x07, 2)
    assert len(bench.of(TPDO4)) == 1
    bench.run(100)
    assert [struct.unpack("<H", data[:2])[0] & 0x6F for data in bench.of(TPDO4)] == [0x21, 0x23]
    bench.run(1000)
    times = [heard.at_ms for heard in bench.heard if heard.cob_id == TPDO4]
    assert [round(b - a) for a, b in pairwise(times[1:])] == [300, 300, 300]


def test_a_remote_frame_asks_for_a_pdo_that_allows_it(bench: Bench) -> None:
    bench.start()
    assert bench.ask(TPDO1) == []  # bit 30 of its COB-ID
    assert bench.write(0x1800, 1, TPDO1, 4) == "ok"
    assert len(bench.ask(TPDO1)) == 1


def test_transmission_type_zero_goes_with_the_sync_after_a_change(bench: Bench) -> None:
    bench.start()
    assert bench.write(0x1800, 2, 0, 1) == "ok"
    bench.run(1)
    bench.send(0x080)
    assert bench.of(TPDO1) == []
    bench.controlword(0x06)
    bench.send(0x080)
    bench.send(0x080)
    assert len(bench.of(TPDO1)) == 1


def test_a_mapping_changes_only_by_the_proper_sequence(bench: Bench) -> None:
    bench.boot()
    velocity = 0x606C_0020
    assert bench.write(0x1A00, 0, 0, 1) == "08000022"  # while the PDO is valid
    assert bench.write(0x1A00, 2, velocity, 4) == "08000022"
    assert bench.write(0x1800, 1, 0xC000_0000 | TPDO1, 4) == "ok"
    assert bench.write(0x1A00, 2, velocity, 4) == "06010000"  # while it maps objects
    assert bench.write(0x1A00, 0, 0, 1) == "ok"
    assert bench.write(0x1A00, 2, 0x6065_0020, 4) == "06040041"  # not mappable
    assert bench.write(0x1A00, 2, 0x606C_0010, 4) == "06040041"  # wrong length
    assert bench.write(0x1A00, 2, 0x5FFF_0010, 4) == "06020000"
    assert bench.write(0x1A00, 2, velocity, 4) == "ok"
    assert bench.write(0x1A00, 3, 0x6064_0020, 4) == "ok"
    assert bench.write(0x1A00, 0, 3, 1) == "06040042"  # 80 bits
    assert bench.write(0x1A00, 0, 2, 1) == "ok"
    assert bench.write(0x1800, 1, 0x4000_0000 | TPDO1, 4) == "ok"
    bench.send(0x000, "01 00")
    bench.send(0x080)
    assert len(bench.of(TPDO1)[-1]) == 6
    assert struct.unpack("<Hi", bench.of(TPDO1)[-1])[1] == bench.read(0x606C, signed=True)
