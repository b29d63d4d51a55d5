"""SDO transfers, observed from outside: expedited, segmented and block (CiA 301 §7.2.4).

A frame may be missing, and a conversation may have begun before we came: what does not fit is called what it
is, and nothing is made up.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum, auto
from typing import Any, ClassVar

from drivers.bus.sdo.aborts import abort_text

_ABORT = 0x80
_SEGMENT = 7
_LAST_IN_BLOCK = 0x80

Object = tuple[int, int]
Handler = Callable[[Any, bytes], "SdoText"]


@dataclass(frozen=True, slots=True)
class SdoText:
    """One frame: `words` name the object as `{}`; `value` where the last byte of it has come.

    `done`: the transfer is over, and was not refused.
    """

    words: str
    object: Object | None = None
    value: bytes | None = None
    done: bool = False
    is_write: bool = False


class _Blocks(Enum):
    NONE = auto()
    FROM_CLIENT = auto()
    FROM_SERVER = auto()


@dataclass(slots=True)
class Conversation:
    """One channel; fed with every frame of it, in their order."""

    _object: Object | None = None
    _is_write: bool = False
    _data: bytearray = field(default_factory=bytearray)
    _announced: int | None = None  # bytes
    _written: bytes | None = None  # what the device is still to confirm
    _blocks: _Blocks = _Blocks.NONE
    _block: list[bytes] = field(default_factory=list)

    def request(self, data: bytes) -> SdoText:
        """Return a frame of the client."""
        if len(data) != 8:
            return SdoText(f"no SDO: {len(data)} bytes")
        if self._blocks is _Blocks.FROM_CLIENT and data[0] != _ABORT:
            return self._block_segment(data)
        return self._REQUESTS.get(data[0] >> 5, _unknown)(self, data)

    def response(self, data: bytes) -> SdoText:
        """Return a frame of the server."""
        if len(data) != 8:
            return SdoText(f"no SDO: {len(data)} bytes")
        if self._blocks is _Blocks.FROM_SERVER and data[0] != _ABORT:
            return self._block_segment(data)
        return self._RESPONSES.get(data[0] >> 5, _unknown)(self, data)

    # -- beginnings ----------------------------------------------------------------------------------------

    def _begin(self, data: bytes, *, write: bool) -> Object:
        about = int.from_bytes(data[1:3], "little"), data[3]
        self._object, self._is_write, self._written, self._announced = about, write, None, None
        self._data, self._block, self._blocks = bytearray(), [], _Blocks.NONE
        return about

    def _download(self, data: bytes) -> SdoText:
        about = self._begin(data, write=True)
        if not data[0] & 0x02:
            return SdoText(
                f"write {{}}, {self._size(data, data[0] & 0x01)} in segments", about, is_write=True
            )
        self._written = _expedited(data)
        return SdoText("write {}", about, self._written, is_write=True)

    def _upload(self, data: bytes) -> SdoText:
        return SdoText("read {}", self._begin(data, write=False))

    def _uploaded(self, data: bytes) -> SdoText:
        about = int.from_bytes(data[1:3], "little"), data[3]
        if self._is_write or about != self._object:
            self._begin(data, write=False)
        if data[0] & 0x02:
            return SdoText("is {}", about, _expedited(data), done=True)
        return SdoText(f"has {{}}, {self._size(data, data[0] & 0x01)} in segments", about)

    def _downloaded(self, data: bytes) -> SdoText:
        about = int.from_bytes(data[1:3], "little"), data[3]
        if about != self._object or not self._is_write:
            return SdoText("took {}, of which no request was heard", about)
        if self._written is None:
            return SdoText("waits for the segments of {}", about, is_write=True)
        return SdoText("took {}", about, self._written, done=True, is_write=True)

    def _abort(self, data: bytes) -> SdoText:
        about = int.from_bytes(data[1:3], "little"), data[3]
        self._object, self._blocks = None, _Blocks.NONE
        return SdoText(f"abort {{}}: {abort_text(int.from_bytes(data[4:8], 'little'))}", about)

    # -- segments ------------------------------------------------------------------------------------------

    def _segment(self, data: bytes) -> SdoText:
        """Return a segment of a write, or of a read."""
        if self._object is None:
            return SdoText("a segment of a transfer whose beginning was not heard")
        self._data += data[1 : 8 - (data[0] >> 1 & 7)]
        if not data[0] & 0x01:
            return SdoText(f"segment of {{}}, {len(self._data)} bytes so far", self._object)
        if missing := self._missing():
            return missing
        value = bytes(self._data)
        if self._is_write:
            self._written = value
            return SdoText(f"last segment of {{}}, {len(value)} bytes", self._object, value, is_write=True)
        return SdoText("is {}", self._object, value, done=True)

    def _ask_segment(self, _data: bytes) -> SdoText:
        return SdoText("next segment of {}", self._object) if self._object else SdoText("next segment")

    def _segment_taken(self, _data: bytes) -> SdoText:
        if self._written is None or self._object is None:
            return SdoText("took a segment of {}" if self._object else "took a segment", self._object)
        return SdoText("took {}", self._object, self._written, done=True, is_write=True)

    # -- blocks --------------------------------------------------------------------------------------------

    def _block_download(self, data: bytes) -> SdoText:
        if data[0] & 0x01:
            return self._block_end(data)
        about = self._begin(data, write=True)
        return SdoText(f"write {{}}, {self._size(data, data[0] & 0x02)} in blocks", about, is_write=True)

    def _block_upload(self, data: bytes) -> SdoText:
        step = data[0] & 0x03
        if step == 0:
            return SdoText("read {} in blocks", self._begin(data, write=False))
        if step == 3:
            self._blocks = _Blocks.FROM_SERVER
            return SdoText("begin with the blocks of {}", self._object)
        if step == 2:
            return self._acknowledged(data, _Blocks.FROM_SERVER)
        return self._missing() or SdoText("is {}", self._object, bytes(self._data), done=True)

    def _block_uploaded(self, data: bytes) -> SdoText:
        """Return the server's side of a block upload: its beginning, or its end."""
        if data[0] & 0x01:
            return self._block_end(data)
        return SdoText(f"has {{}}, {self._size(data, data[0] & 0x02)} in blocks", self._object)

    def _block_downloaded(self, data: bytes) -> SdoText:
        """Return the server's side of a block download: go on, so much has come, or it is over."""
        step = data[0] & 0x03
        if step == 0:
            self._blocks = _Blocks.FROM_CLIENT
            return SdoText(
                f"begin with the blocks of {{}}, {data[4]} segments each", self._object, is_write=True
            )
        if step == 2:
            return self._acknowledged(data, _Blocks.FROM_CLIENT)
        return self._missing() or SdoText(
            "took {}", self._object, bytes(self._data), done=True, is_write=True
        )

    def _block_segment(self, data: bytes) -> SdoText:
        """Return a segment: bit 7 marks the last of all. The other side acknowledges the block next."""
        self._block.append(data[1:])
        if data[0] & _LAST_IN_BLOCK:
            self._blocks = _Blocks.NONE
        return SdoText(f"segment {data[0] & 0x7F} of a block of {{}}", self._object, is_write=self._is_write)

    def _acknowledged(self, data: bytes, source: _Blocks) -> SdoText:
        """Return that so many segments of the block have come; the others are sent again."""
        kept = data[1]
        complete = kept >= len(self._block) and self._blocks is _Blocks.NONE
        self._data += b"".join(self._block[:kept])
        self._block = []
        if not complete:
            self._blocks = source
        return SdoText(f"{kept} segments of {{}} came", self._object, is_write=self._is_write)

    def _block_end(self, data: bytes) -> SdoText:
        """Decode the last segment, without its unused bytes."""
        unused = data[0] >> 2 & 7
        if unused:
            del self._data[-unused:]
        return SdoText(f"end of {{}}, {len(self._data)} bytes", self._object, is_write=self._is_write)

    def _size(self, data: bytes, told: int) -> str:
        """Note how many bytes are announced."""
        self._announced = int.from_bytes(data[4:8], "little") if told else None
        return "an untold number of bytes" if self._announced is None else f"{self._announced} bytes"

    def _missing(self) -> SdoText | None:
        """Return what is said of a finished value that was not heard as a whole."""
        if self._object is None:
            return SdoText("the end of a transfer whose beginning was not heard")
        if self._announced in (None, len(self._data)):
            return None
        words = f"end of {{}}: {len(self._data)} of {self._announced} bytes were heard"
        return SdoText(words, self._object, is_write=self._is_write)

    # By command specifier, the upper three bits of the first byte.
    _REQUESTS: ClassVar[dict[int, Handler]] = {
        0: _segment,
        1: _download,
        2: _upload,
        3: _ask_segment,
        4: _abort,
        5: _block_upload,
        6: _block_download,
    }
    _RESPONSES: ClassVar[dict[int, Handler]] = {
        0: _segment,
        1: _segment_taken,
        2: _uploaded,
        3: _downloaded,
        4: _abort,
        5: _block_downloaded,
        6: _block_uploaded,
    }


def _unknown(_conversation: object, data: bytes) -> SdoText:
    return SdoText(f"no SDO command: 0x{data[0]:02X}")


def _expedited(data: bytes) -> bytes:
    unused = data[0] >> 2 & 3 if data[0] & 0x01 else 0
    return data[4 : 8 - unused]
