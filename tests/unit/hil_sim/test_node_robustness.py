"""Whatever comes over the bus, a device goes on: it answers or refuses, and never falls over."""

import random

import pytest

import eds
from eds.shipped import shipped
from hil_sim.bus.can_bus import Frame
from hil_sim.node.coding import size
from hil_sim.node.dictionary import Entry
from tests.unit.hil_sim.bench import NODE, Bench

FRAMES = 3000
CONTROLWORD = (0x6040, 0)
NMT_SERVICES = (1, 1, 1, 1, 128, 2, 130)


def some_write(source: random.Random, entry: Entry) -> bytes:
    """A download of the right length, in what values there is trouble."""
    index, subindex = entry.key
    length = min(size(entry.data_type) or 4, 4)
    values = (source.getrandbits(32), source.randrange(9), 0, 0xFFFF_FFFF, 0x8000_0000, 0x7F, 0xFF, 1000)
    data = (source.choice(values) & (1 << 8 * length) - 1).to_bytes(4, "little")
    head = bytes([0x23 | (4 - length) << 2]) + index.to_bytes(2, "little") + bytes([subindex])
    return head + source.choice((data, data, data, b"save", b"load"))


def some_request(source: random.Random, entry: Entry) -> bytes:
    """Something that begins, continues or breaks off a transfer."""
    commands = (0x40, 0x60, 0x70, 0x00, 0x01, 0x11, 0x21, 0xA4, 0xA3, 0xA2, 0xA1, 0xC4, 0xC6, 0xC1, 0x80)
    command = source.choice((*commands, source.randrange(256)))
    index, subindex = entry.key
    return bytes([command]) + index.to_bytes(2, "little") + bytes([subindex]) + source.randbytes(4)


def some_frame(source: random.Random, entries: list[Entry]) -> Frame:
    kind, entry = source.random(), source.choice(entries)
    if kind < 0.4:
        return Frame(0x600 + NODE, some_write(source, entry))
    if kind < 0.7:
        return Frame(0x600 + NODE, some_request(source, entry))
    if kind < 0.75:
        return Frame(0x000, bytes([source.choice(NMT_SERVICES), source.choice((0, NODE))]))
    cob_ids = (0x080, 0x700 + NODE, 0x701, 0x180 + NODE, 0x200 + NODE, source.randrange(0x800))
    return Frame(source.choice(cob_ids), source.randbytes(source.randrange(9)), remote=source.random() < 0.3)


def enable(bench: Bench) -> None:
    """As far as it goes: from any state, in any mode."""
    bench.send(0x600 + NODE, "80 00 00 00 00 00 00 00")
    bench.send(0x000, "01 00")
    for controlword in (0x00, 0x80, 0x06, 0x07, 0x0F, 0x1F) if CONTROLWORD in bench.node.dictionary else ():
        bench.send(0x600 + NODE, f"2B 40 60 00 {controlword:02X} 00 00 00")


def bother(bench: Bench, source: random.Random, frames: int) -> None:
    entries = list(bench.node.dictionary)
    for count in range(frames):
        if count % 50 == 0:
            enable(bench)
        bench.bus.send(some_frame(source, entries), bench)
        bench.run(source.choice((0.3, 0.5, 3.0)))


@pytest.mark.parametrize("name", [name for name in shipped() if name != "gait_controller.eds"])
def test_a_device_survives_everything(name: str) -> None:
    bench = Bench(file=eds.locate(name, None))
    bench.start()
    bother(bench, random.Random(name), FRAMES)
    bench.heard.clear()
    bench.send(0x000, f"82 {NODE:02X}")
    bench.run(100)
    assert bench.of(0x700 + NODE)[0] == b"\x00"
    bench.sdo("80 00 00 00 00 00 00 00")
    index, subindex = next(entry.key for entry in bench.node.dictionary if entry.readable)
    assert bench.sdo(f"40 {index & 0xFF:02X} {index >> 8:02X} {subindex:02X} 00 00 00 00") is not None
