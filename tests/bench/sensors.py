"""`./dev bench sensors`: what parsing costs beside the plain way, and how soon bytes become a value."""

import binascii
import os
import pty
import struct
import subprocess
import sys
import tempfile
import threading
import time
import tty
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module, util
from pathlib import Path
from typing import Any

from drivers.imu.device import Imu
from drivers.imu.formats.bno08x_rvc import Bno08xRvcParser
from drivers.imu.formats.vectornav import VectornavParser
from drivers.imu.formats.witmotion import WitmotionParser
from drivers.imu.formats.xsens import XsensParser
from drivers.imu.settings import ImuSettings
from drivers.insole import layout as layouts
from drivers.insole.build import pair
from drivers.insole.device import Insole
from drivers.insole.foot import FEET
from drivers.insole.formats import FORMATS
from drivers.insole.formats.insole_cobs import InsoleCobsParser
from drivers.insole.settings import InsoleSettings
from drivers.line import Line
from drivers.parsing import Counters
from drivers.samples import Sample
from tests.bench._serial_sender import RATE_HZ, frames
from tests.unit.imu import encode as imu
from tests.unit.insole.encode import cobs_frame, eighteen_cell_frame

FRAMES = 4000
CHUNK = 64  # bytes a read, as USB adapters give them
ROUNDS = 5
SECONDS = 10
PASCAL_PER_COUNT = 100.0
SECOND_NS = 1_000_000_000
MOST_CPU, MOST_LATENCY_MS = 0.03, 2.0

Read = Callable[[bytes], int]


def main() -> int:
    """Print the figures; 1 where cost or latency is over its limit."""
    head = f"{'format':<14}{'ours':>10}{'by hand':>10}{'library':>10}"
    sys.stdout.write(f"{head}   µs a frame, chunks of {CHUNK} B\n")
    for name, (data, ours, *others) in _streams().items():
        costs = [_cost(data, read) for read in (ours, *others)]
        cells = [f"{cost:10.2f}" if cost is not None else f"{'–':>10}" for cost in costs]
        sys.stdout.write(f"{name:<14}{''.join(cells)}\n")
    sys.stdout.write(
        f"\ntwo 16-cell insoles and an IMU at 200 Hz over pseudo-terminals, {SECONDS} s each, "
        "share of one core:\n"
    )
    reading, parsing, whole = (_live(make) for make in (_reading, _parsing, _components))
    latencies: list[float] = []
    _live(_components, _Latencies(latencies))
    p50, p99 = (sorted(latencies)[round(share * (len(latencies) - 1))] for share in (0.5, 0.99))
    sys.stdout.write(
        f"  waking up and reading                      {reading:.2%}\n"
        f"  … and parsing                              {parsing:.2%}  (limit {MOST_CPU:.0%})\n"
        f"  … and clock, calibration, force, centre of\n"
        f"    pressure, tilt, checks, latest values    {whole:.2%}\n"
        "the same bytes in a row, without waking up:\n"
        f"  parsing                                    {_in_a_row(_parsing):.2%}\n"
        f"  … and all the rest                         {_in_a_row(_components):.2%}\n"
        f"bytes → latest value: p50 {p50:.2f} ms, p99 {p99:.2f} ms of {len(latencies)} "
        f"(limit {MOST_LATENCY_MS} ms)\n"
    )
    return int(parsing > MOST_CPU or p99 > MOST_LATENCY_MS)


def _streams() -> dict[str, tuple[bytes, Read | None, Read | None, Read | None]]:
    """Format → bytes of `FRAMES` frames, and how ours, the plain way and a library read them."""
    numbers = range(FRAMES)
    euler = [
        imu.mtdata2({0x1020: struct.pack(">H", n), 0x2030: struct.pack(">3f", 1, 2, 3)}) for n in numbers
    ]
    eighteen = FORMATS["insole-frame"].parser(layouts.load("insole-18"))
    csv = b"seq,ch0,ch1,ch2,ch3\n" + b"".join(b"%d,10,20,30,40\n" % n for n in numbers)
    return {
        "insole-cobs": (
            b"".join(cobs_frame(range(100, 116), sequence=n, time_us=5000 * n) for n in numbers),
            _ours(InsoleCobsParser),
            _by_cobs(_plain_cobs),
            _by_cobs(import_module("cobs.cobs").decode),
        ),
        "insole-frame": (
            b"".join(eighteen_cell_frame(1, range(18)) for _ in numbers),
            _ours(eighteen),
            _eighteen_by_hand,
            None,
        ),
        "insole-csv": (csv, _ours(FORMATS["insole-csv"].parser(None)), _csv_by_hand, None),
        "witmotion": (
            b"".join(imu.witmotion(0x51, n % 99, 2, 3, 4) for n in numbers),
            _ours(WitmotionParser),
            _witmotion_by_hand,
            _witmotion_library,
        ),
        "bno08x-rvc": (
            b"".join(imu.bno08x_rvc(n, 1, 2, 3, 4, 5, 1000) for n in numbers),
            _ours(Bno08xRvcParser),
            _rvc_by_hand,
            _rvc_library(),
        ),
        "xsens": (b"".join(euler), _ours(XsensParser), _xsens_by_hand, None),
        "vectornav": (
            b"".join(imu.vectornav_ascii(f"VNYPR,+{n % 180:03d}.5,-001.0,+000.5") for n in numbers),
            _ours(VectornavParser),
            _vectornav_by_hand,
            None,
        ),
    }


def _cost(data: bytes, read: Read | None) -> float | None:
    """The best of a few rounds, µs of CPU a frame."""
    if read is None:
        return None
    best = float("inf")
    for _ in range(ROUNDS):
        began = time.process_time()
        frames = read(data)
        best = min(best, time.process_time() - began)
        if frames != FRAMES:
            raise RuntimeError(f"{frames} of {FRAMES} frames were read")
    return best / FRAMES * 1e6


def _chunks(data: bytes) -> Iterator[bytes]:
    return (data[at : at + CHUNK] for at in range(0, len(data), CHUNK))


def _ours(make_parser: Callable[[], Any]) -> Read:
    def read(data: bytes) -> int:
        parser = make_parser()
        return sum(len(parser.feed(chunk)) for chunk in _chunks(data))

    return read


def _sliced(sync: bytes, length: int, take: Callable[[bytes], object]) -> Read:
    """The plain way: join, find, slice, check, unpack. It neither counts nor bounds nor gets back in step."""

    def read(data: bytes) -> int:
        frames, buffer = 0, b""
        for chunk in _chunks(data):
            buffer += chunk
            while (start := buffer.find(sync)) >= 0 and len(buffer) >= start + length:
                raw = buffer[start : start + length]
                buffer = buffer[start + length :]
                frames += take(raw) is not None
        return frames

    return read


def _take_witmotion(raw: bytes) -> object:
    if sum(raw[:10]) & 0xFF != raw[10]:
        return None
    a, b, c, t = struct.unpack_from("<4h", raw, 2)
    return (raw[1], a * 16 * 9.80665 / 32768, b * 16 * 9.80665 / 32768, c * 16 * 9.80665 / 32768, t / 100)


def _take_rvc(raw: bytes) -> object:
    if sum(raw[2:18]) & 0xFF != raw[18]:
        return None
    return [value * 0.01 for value in struct.unpack_from("<6h", raw, 3)]


def _take_eighteen(raw: bytes) -> object:
    return None if sum(raw[:38]) & 0xFF != raw[38] else struct.unpack_from(">18H", raw, 2)


def _take_xsens(raw: bytes) -> object:
    if sum(raw[1:]) & 0xFF:
        return None
    (counter,) = struct.unpack_from(">H", raw, 7)
    return counter, [angle * 0.017453292519943295 for angle in struct.unpack_from(">3f", raw, 12)]


_witmotion_by_hand = _sliced(b"\x55", 11, _take_witmotion)
_rvc_by_hand = _sliced(b"\xaa\xaa", 19, _take_rvc)
_eighteen_by_hand = _sliced(b"\xaa", 39, _take_eighteen)
_xsens_by_hand = _sliced(b"\xfa\xff", 25, _take_xsens)


def _by_lines(take: Callable[[bytes], object], end: bytes = b"\n") -> Read:
    def read(data: bytes) -> int:
        frames, buffer = 0, b""
        for chunk in _chunks(data):
            *lines, buffer = (buffer + chunk).split(end)
            frames += sum(take(line) is not None for line in lines)
        return frames

    return read


def _take_csv(line: bytes) -> object:
    return None if line.startswith(b"seq") else [int(field) for field in line.split(b",")]


def _take_vectornav(line: bytes) -> object:
    body, _, checksum = line.strip()[1:].partition(b"*")
    total = 0
    for byte in body:
        total ^= byte
    return None if total != int(checksum, 16) else [float(field) for field in body.split(b",")[1:]]


_csv_by_hand, _vectornav_by_hand = _by_lines(_take_csv), _by_lines(_take_vectornav)


def _plain_cobs(encoded: bytes) -> bytes:
    decoded, at = b"", 0
    while at < len(encoded):
        end = at + encoded[at]
        decoded += encoded[at + 1 : end] + b"\0"
        at = end
    return decoded[:-1]


def _by_cobs(decode: Callable[[bytes], bytes]) -> Read:
    """The stuffing by hand or by PyPI `cobs`, struct for the rest."""

    def take(raw: bytes) -> object:
        body = decode(raw)
        if binascii.crc_hqx(body[:-2], 0xFFFF) != int.from_bytes(body[-2:], "little"):
            return None
        return [count * 100.0 for count in struct.unpack_from(f"<{body[8]}H", body, 10)]

    return _by_lines(take, b"\0")


def _witmotion_library(data: bytes) -> int:
    """PyPI `witmotion`: its messages; finding and checking the frames as it does in its reader."""
    protocol = import_module("witmotion.protocol")
    kinds = {protocol.AccelerationMessage.code: protocol.AccelerationMessage}

    def take(raw: bytes) -> object:
        kind = kinds[raw[1]]
        return kind.parse(raw[2:10]) if kind.compute_checksum(raw[2:10]) == raw[10] else None

    return _sliced(b"\x55", 11, take)(data)


def _rvc_library() -> Read | None:
    """PyPI `adafruit-circuitpython-bno08x-rvc`, where it is installed (it needs a board's libraries)."""
    if util.find_spec("adafruit_bno08x_rvc") is None:
        return None
    parse = import_module("adafruit_bno08x_rvc").BNO08x_RVC._parse_frame
    return _sliced(b"\xaa\xaa", 19, lambda raw: parse(raw[2:]))


@contextmanager
def _terminals(folder: Path) -> Iterator[list[tuple[int, str]]]:
    made = []
    try:
        for name in ("left", "right", "trunk"):
            master, slave = pty.openpty()
            tty.setraw(slave)
            (folder / name).symlink_to(os.ttyname(slave))
            os.close(slave)
            made.append((master, str(folder / name)))
        yield made
    finally:
        for master, _ in made:
            os.close(master)


class _Nobody:
    """Takes frames and does nothing with them."""

    def __init__(self, line: Line[Any]) -> None:
        self.line = line

    def start(self) -> None:
        self.line.start(self)

    def stop(self) -> None:
        self.line.stop(self)

    def received(self, frames: object, stamp_ns: int) -> None: ...

    def disconnected(self) -> None: ...


class _Nothing:
    """A parser that finds nothing."""

    def __init__(self) -> None:
        self.counters = Counters()

    def feed(self, data: bytes) -> list[object]:
        return []

    def finish(self) -> list[object]:
        return []


class _Latencies:
    """Listens to insoles whose first two cells say when their frame was sent (µs), in ms."""

    def __init__(self, found: list[float]) -> None:
        self._found = found

    def __call__(self, sample: Sample) -> None:
        now_us = time.monotonic_ns() // 1000 & 0xFFFFFFFF
        low, high = sample.values[3] or 0.0, sample.values[4] or 0.0
        sent_us = round(low / PASCAL_PER_COUNT) | round(high / PASCAL_PER_COUNT) << 16
        self._found.append(((now_us - sent_us) & 0xFFFFFFFF) / 1e3)


Live = Sequence[Insole | Imu | _Nobody]
Make = Callable[[Path, list[str]], Live]


def _reading(_: Path, ports: list[str]) -> Live:
    return [_Nobody(Line(port, 115200, "none", _Nothing)) for port in ports]


def _parsing(_: Path, ports: list[str]) -> Live:
    left, right, trunk = ports
    insoles = [Line(port, 230400, "insole-cobs", InsoleCobsParser) for port in (left, right)]
    return [*map(_Nobody, insoles), _Nobody(Line(trunk, 115200, "witmotion", WitmotionParser))]


def _components(folder: Path, ports: list[str]) -> Live:
    (folder / "cells.toml").write_text(f"[default]\ngain = {PASCAL_PER_COUNT}\n", encoding="ascii")
    settings = [InsoleSettings(port=port, calibration="cells.toml") for port in ports[:2]]
    left, right = (
        Insole(f"{side}_insole", one, beside=folder) for side, one in zip(FEET, settings, strict=True)
    )
    pair([left, right])
    return [left, right, Imu("trunk", ImuSettings(port=ports[2]))]


def _live(make: Make, listener: Callable[[Sample], None] | None = None) -> float:
    """CPU share of the serial threads, with real ports and threads."""
    with tempfile.TemporaryDirectory() as name, _terminals(Path(name)) as ports:
        users = make(Path(name), [path for _, path in ports])
        for user in users:
            if listener is not None and isinstance(user, Insole):
                user.latest.subscribe(listener)
            user.start()
        try:
            return _spent(users, [master for master, _ in ports]) / SECONDS
        finally:
            for user in users:
                user.stop()


def _in_a_row(make: Make) -> float:
    """Share of one core that the code alone takes, best of a few rounds: no thread, no port, warm caches."""
    cycles, best = [frames(number) for number in range(FRAMES // 4)], float("inf")
    with tempfile.TemporaryDirectory() as name:
        for _ in range(ROUNDS):
            users = make(Path(name), ["left", "right", "trunk"])
            for user in users:
                user.line._users = (user,)
            began = time.process_time()
            for number, cycle in enumerate(cycles):
                for user, data in zip(users, cycle, strict=True):
                    user.line._received(data, SECOND_NS + number * SECOND_NS // RATE_HZ)
            best = min(best, time.process_time() - began)
    return best / len(cycles) * RATE_HZ


def _spent(users: Live, masters: list[int]) -> float:
    """CPU seconds of the serial threads while the sender sends."""
    deadline = time.monotonic() + 10
    while any("opened" in (user.line.problem(time.monotonic_ns()) or "") for user in users):
        if time.monotonic() > deadline:
            raise RuntimeError("the pseudo-terminals did not open")
        time.sleep(0.01)
    threads = [thread for thread in threading.enumerate() if thread.name.startswith("serial ")]
    clocks = [time.pthread_getcpuclockid(thread.ident or 0) for thread in threads]
    before = sum(map(time.clock_gettime, clocks))
    command = [sys.executable, "-m", "tests.bench._serial_sender", *map(str, masters), str(SECONDS)]
    subprocess.run(command, pass_fds=masters, check=True)
    return sum(map(time.clock_gettime, clocks)) - before


if __name__ == "__main__":
    sys.exit(main())
