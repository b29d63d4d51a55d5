"""NMT, heartbeat, emergencies and storage of a device (CiA 301 §7.2.7, §7.2.8)."""

from itertools import pairwise

from tests.unit.hil_sim.bench import NODE, Bench


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


def test_stored_parameters_survive_a_reset_and_can_be_restored(bench: Bench) -> None:
    bench.boot()
    bench.write(0x6072, 0, 500, 2)
    assert bench.write(0x1010, 1, 0x12345678, 4) == "08000020"
    assert bench.write(0x1010, 1, 0x65766173, 4) == "ok"
    assert bench.read(0x1010, 1) == 1
    bench.send(0x000, "81 00")
    bench.run(60)
    assert bench.read(0x6072) == 500
    assert bench.write(0x1011, 1, 0x64616F6C, 4) == "ok"
    assert bench.read(0x6072) == 500  # takes effect with the next reset
    bench.send(0x000, "81 00")
    bench.run(60)
    assert bench.read(0x6072) == 2000


def test_an_error_makes_an_emergency_a_register_bit_and_a_history(bench: Bench) -> None:
    bench.boot()
    bench.drive.fault(0x4310)
    bench.run(2)
    assert bench.of(0x80 + NODE) == [bytes.fromhex("10 43 09 00 00 00 00 00")]
    assert bench.read(0x1001) == 0x09
    assert bench.read(0x1003) == 1
    assert bench.read(0x1003, 1) == 0x4310
    assert bench.read(0x603F) == 0x4310
    assert bench.read(0x6041) & 0x4F == 0x08
    bench.controlword(0x80)
    assert bench.of(0x80 + NODE)[-1] == bytes(8)
    assert bench.read(0x1001) == 0
    assert bench.write(0x1003, 0, 1, 1) == "06090031"
    assert bench.write(0x1003, 0, 0, 1) == "ok"
    assert bench.read(0x1003) == 0


def test_a_missing_heartbeat_is_an_emergency_and_stops_the_drive(bench: Bench) -> None:
    bench.start()
    bench.enable()
    bench.write(0x1016, 1, 0x0010_0064, 4)  # node 16 within 100 ms
    bench.run(500)
    assert bench.read(0x6041) & 0x6F == 0x27  # watching begins with the first heartbeat
    bench.send(0x710, "05")
    bench.run(90)
    bench.send(0x710, "05")
    assert bench.read(0x6041) & 0x6F == 0x27
    bench.run(200)
    assert bench.of(0x80 + NODE)[0][:2] == b"\x30\x81"
    assert bench.read(0x6041) & 0x4F == 0x40
