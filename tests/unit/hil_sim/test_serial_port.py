"""The serial sensors' pseudo-terminals: stable links, in and out, and no reader can stop the robot."""

import select
from pathlib import Path

import pytest
import serial

from hil_sim.sensors.serial_port import SerialPort


def test_bytes_arrive_raw_at_the_link(tmp_path: Path) -> None:
    port = SerialPort(tmp_path / "sensor", 230400)
    with serial.Serial(str(tmp_path / "sensor"), 230400, timeout=5) as reader:
        data = bytes(range(256))
        port.write(data)
        assert reader.read(256) == data
    port.close()
    assert not (tmp_path / "sensor").is_symlink()


def test_without_a_reader_old_bytes_are_dropped_and_fresh_ones_found(tmp_path: Path) -> None:
    frames = [number.to_bytes(4, "big") for number in range(20_000)]
    port = SerialPort(tmp_path / "sensor", 230400)
    try:
        for frame in frames:
            port.write(frame)
        # The kernel moves bytes along in its own time: what it flushed on their way is not in the count.
        assert port.bytes_dropped > 0
        dropped, found = port.bytes_dropped, b""
        with (tmp_path / "sensor").open("rb", buffering=0) as reader:
            while select.select([reader], [], [], 0.2)[0]:
                found += reader.read(4096)
            assert len(found) <= 4 * len(frames) - dropped
            port.write(b"fresh")
            assert select.select([reader], [], [], 60.0)[0], "a fresh frame never arrived"
            assert reader.read(4096) == b"fresh"
    finally:
        port.close()


def test_a_stale_link_is_replaced_and_a_foreign_one_left_alone(tmp_path: Path) -> None:
    link = tmp_path / "sensor"
    link.symlink_to("/dev/pts/nowhere")
    port = SerialPort(link, 115200)
    assert link.readlink() != Path("/dev/pts/nowhere")
    link.unlink()
    link.symlink_to("/dev/null")
    port.close()
    port.close()
    assert link.readlink() == Path("/dev/null")


def test_the_readers_baud_rate_is_known_and_is_the_devices_own_until_one_is_set(tmp_path: Path) -> None:
    port = SerialPort(tmp_path / "sensor", 230400)
    assert port.baudrate == 230400
    with serial.Serial(str(port.link), 9600):
        assert port.baudrate == 9600
    port.close()


def test_an_unplugged_port_hangs_up_and_comes_back_at_the_same_path(tmp_path: Path) -> None:
    port = SerialPort(tmp_path / "sensor", 115200)
    with serial.Serial(str(port.link), 115200, timeout=5) as reader:
        port.plug(False)
        port.plug(False)
        assert not port.link.is_symlink()
        with pytest.raises(serial.SerialException):
            reader.read(1)
    port.plug(True)
    with serial.Serial(str(port.link), 115200, timeout=5) as reader:
        port.write(b"again")
        assert reader.read(5) == b"again"
    port.close()
