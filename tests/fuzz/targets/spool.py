"""What a spool's file holds: layouts, records and packed rows."""

import msgspec

from server_gui.core.recording.errors import SpoolUnusable
from server_gui.core.recording.rows import KEYS, Layout, Record, pack, unpack
from server_gui.core.recording.segment import translated
from tests.fuzz.files import FOLDER

TOKENS = (b"\x82\xa8channels", b"\xa5units", b"\x92\xa5table", b"\x91\xa1a", bytes(8))
MODULES = ("server_gui.core.recording.rows",)


def fuzz(data: bytes) -> None:
    for what in (_rows, _layout, _record):
        try:
            with translated(FOLDER / "spool"):
                what(data)
        except SpoolUnusable as error:
            assert "is damaged" in str(error)


def _rows(data: bytes) -> None:
    data = data or b"\0"
    width = data[0] % 4
    run = unpack("r", "s", "c", 1, Layout(("x",) * width, (None,) * width), data[1:])
    assert len(run) * (KEYS + width) * 8 == len(data) - 1
    assert pack(run) == data[1:]


def _layout(data: bytes) -> None:
    found = msgspec.msgpack.decode(data, type=Layout)
    assert msgspec.msgpack.decode(msgspec.msgpack.encode(found), type=Layout) == found


def _record(data: bytes) -> None:
    msgspec.msgpack.encode(msgspec.msgpack.decode(data, type=Record))
