"""The serial sensors' pseudo-terminals: stable links, and nobody who reads can stop the robot."""

from pathlib import Path

import serial

from hil_sim.sensors.serial_port import SerialPort


def test_bytes_arrive_raw_at_the_link(tmp_path: Path) -> None:
    port = SerialPort(tmp_path / "sensor")
    with serial.Serial(str(tmp_path / "sensor"), 230400, timeout=5) as reader:
        data = bytes(range(256))
        port.write(data)
        assert reader.read(256) == data
    port.close()
    assert not (tmp_path / "sensor").is_symlink()


def test_without_a_reader_old_bytes_are_dropped_and_fresh_ones_found(tmp_path: Path) -> None:
    port = SerialPort(tmp_path / "sensor")
    for number in range(20_000):
        port.write(number.to_bytes(4, "big"))
    assert port.bytes_dropped > 70_000
    with (tmp_path / "sensor").open("rb", buffering=0) as reader:
        waiting = reader.read(4096)
        assert len(waiting) <= 2052
        assert int.from_bytes(waiting[-4:], "big") == 19_999
    port.close()


def test_a_stale_link_is_replaced_and_a_foreign_one_left_alone(tmp_path: Path) -> None:
    link = tmp_path / "sensor"
    link.symlink_to("/dev/pts/nowhere")
    port = SerialPort(link)
    assert link.readlink() != Path("/dev/pts/nowhere")
    link.unlink()
    link.symlink_to("/dev/null")
    port.close()
    port.close()
    assert link.readlink() == Path("/dev/null")
