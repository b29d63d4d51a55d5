"""NMT of a device: its states, what lives in each, what a reset brings back (CiA 301 §7.2.8, §7.3.2)."""

from itertools import pairwise
from pathlib import Path

import pytest

from tests.unit.hil_sim.bench import NODE, Bench, DeviceBench
from tests.unit.hil_sim.device_file import UNSIGNED32, communication


def test_boot_up_then_heartbeats_at_1017h(bench: Bench) -> None:
    bench.boot()
    bench.run(500)
    beats = [heard for heard in bench.heard if heard.cob_id == 0x700 + NODE]
    assert beats[0].data == b"\x00"
    assert all(beat.data == b"\x7f" for beat in beats[1:])
    assert [round(b.at_ms - a.at_ms) for a, b in pairwise(beats)] == [100] * 5


def test_the_heartbeat_shows_every_state(bench: Bench) -> None:
    bench.boot()
    for service, state in (("01", 5), ("02", 4), ("80", 127)):
        bench.send(0x000, f"{service} {NODE:02X}")
        bench.run(110)
        assert bench.of(0x700 + NODE)[-1] == bytes([state])


def test_nmt_for_another_node_does_nothing(bench: Bench) -> None:
    bench.boot()
    bench.send(0x000, f"01 {NODE + 1:02X}")
    bench.run(110)
    assert bench.of(0x700 + NODE)[-1] == b"\x7f"


def test_heartbeat_time_zero_is_silence(bench: Bench) -> None:
    bench.boot()
    assert bench.write(0x1017, 0, 0, 2) == "ok"
    before = len(bench.of(0x700 + NODE))
    bench.run(1000)
    assert len(bench.of(0x700 + NODE)) == before


def test_a_reset_boots_again_with_default_parameters(bench: Bench) -> None:
    bench.boot()
    bench.write(0x6072, 0, 500, 2)
    bench.send(0x000, "81 00")
    bench.run(60)
    assert bench.of(0x700 + NODE)[-1] == b"\x00"
    assert bench.read(0x6072) == 2000


def test_reset_communication_keeps_the_application(bench: Bench) -> None:
    bench.boot()
    bench.write(0x6072, 0, 500, 2)
    bench.write(0x1017, 0, 250, 2)
    bench.send(0x000, "82 00")
    bench.run(60)
    assert bench.read(0x6072) == 500
    assert bench.read(0x1017) == 100


SERVICES = {"start": "01", "stop": "02", "pre": "80", "reset node": "81", "reset communication": "82"}
AFTER = {"start": 5, "stop": 4, "pre": 127, "reset node": 0, "reset communication": 0}


@pytest.mark.parametrize("before", ["start", "stop", "pre"])
@pytest.mark.parametrize("service", SERVICES)
@pytest.mark.parametrize("address", [0, NODE])
def test_every_service_in_every_state(bench: Bench, before: str, service: str, address: int) -> None:
    bench.boot()
    bench.send(0x000, f"{SERVICES[before]} {NODE:02X}")
    bench.heard.clear()
    bench.send(0x000, f"{SERVICES[service]} {address:02X}")
    bench.run(110)
    beats = bench.of(0x700 + NODE)
    assert beats[0][0] == AFTER[service]
    if AFTER[service] == 0:
        bench.run(100)
        assert bench.of(0x700 + NODE)[1:] == [b"\x7f"]


@pytest.mark.parametrize("data", ["", "01", "01 00 00", "03 00", "7F 00", "00 05", "83 00"])
def test_what_is_no_nmt_service_changes_nothing(bench: Bench, data: str) -> None:
    bench.boot()
    bench.send(0x000, data)
    bench.run(110)
    assert bench.of(0x700 + NODE)[-1] == b"\x7f"


def test_a_booting_device_hears_nothing(bench: Bench) -> None:
    bench.boot()
    bench.send(0x000, "81 00")
    bench.send(0x000, "01 00")
    assert bench.sdo("40 00 10 00 00 00 00 00") is None
    bench.run(160)
    assert bench.of(0x700 + NODE)[-2:] == [b"\x00", b"\x7f"]


def test_a_reset_during_the_boot_boots_once(bench: Bench) -> None:
    bench.drive.power_on()
    bench.drive.power_off()
    bench.drive.power_on()
    bench.run(90)
    assert bench.of(0x700 + NODE) == [b"\x00"]


def test_a_stopped_device_shows_its_heartbeat_and_nothing_else(bench: Bench) -> None:
    bench.start()
    bench.write(0x1800, 1, 0x180 + NODE, 4)
    bench.send(0x000, "02 00")
    bench.heard.clear()
    for cob_id in (0x080, 0x200 + NODE, 0x600 + NODE):
        bench.send(cob_id, "40 00 10 00 00 00 00 00" if cob_id != 0x080 else "")
    bench.drive.fault(0x4310)
    bench.ask(0x180 + NODE)
    bench.run(300)
    assert {heard.cob_id for heard in bench.heard} == {0x700 + NODE}
    assert {heard.data for heard in bench.heard} == {b"\x04"}


def test_power_off_is_silence_and_power_on_boots(bench: Bench) -> None:
    bench.start()
    bench.drive.power_off()
    bench.heard.clear()
    bench.send(0x080)
    assert bench.sdo("40 00 10 00 00 00 00 00") is None
    bench.run(1000)
    assert bench.heard == []
    bench.drive.power_on()
    bench.run(60)
    assert bench.of(0x700 + NODE) == [b"\x00"]


def test_a_device_that_loses_power_in_the_middle_of_an_answer_does_not_answer(bench: Bench) -> None:
    bench.boot()
    bench.drive.dictionary[0x6072, 0].on_write = lambda _: bench.drive.power_off()
    assert bench.sdo("2B 72 60 00 E8 03 00 00") is None


@pytest.mark.parametrize(("startup", "state"), [(0x0, 5), (0x4, 127), (0x1, 127), (0x8, 5)])
def test_1f80h_lets_a_device_start_itself(tmp_path: Path, startup: int, state: int) -> None:
    file = communication().add(0x1F80, None, UNSIGNED32, startup).write(tmp_path)
    bench = DeviceBench(file)
    bench.boot()
    bench.write(0x1017, 0, 10, 2)
    assert bench.of(0x700 + NODE)[-1] == bytes([state])
