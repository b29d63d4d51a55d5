"""One SDO transfer on its way: what it is about, what it does, and its last request."""

from collections.abc import Callable, Generator
from dataclasses import dataclass
from functools import partial
from typing import Generic, TypeVar

from drivers.bus.sdo import protocol
from drivers.bus.sdo.outstanding import Request

T = TypeVar("T")


def nothing() -> str | None:
    """No objection."""
    return None


@dataclass(slots=True)
class Transfer(Generic[T]):
    """A read, or a write of `data`; `what` says which, and of which device."""

    begin: Callable[[], Generator[bytes, bytes, T]]
    index: int
    subindex: int
    what: str
    timeout_s: float
    data: bytes | None = None
    permitted: Callable[[], str | None] = nothing
    request: Request | None = None  # the last one that was sent

    @property
    def about(self) -> bytes:
        """Its object, as frames name it."""
        return protocol.multiplexer(self.index, self.subindex)

    @property
    def write_begun(self) -> bool:
        """Whether the device may have taken something of it."""
        return self.data is not None and self.request is not None

    @property
    def is_expedited_write(self) -> bool:
        """Whether its first request is all of it."""
        return self.data is not None and len(self.data) <= protocol.EXPEDITED

    @property
    def late_answer(self) -> bytes | None:
        """The answer to a read that was given up, where it came after all and is all of it."""
        asked = self.request
        if asked is None or asked.answer is None or not protocol.concludes(asked.answer, asked.frame):
            return None
        return asked.answer


def read(label: str, index: int, subindex: int, timeout_s: float) -> Transfer[bytes]:
    """Return a read of an object of the device `label`."""
    what = f"{label}: reading 0x{index:04X}:{subindex:02X}"
    return Transfer(partial(protocol.upload, index, subindex), index, subindex, what, timeout_s)


def write(
    label: str, index: int, subindex: int, data: bytes, timeout_s: float, permitted: Callable[[], str | None]
) -> Transfer[None]:
    """Return a write of an object of the device `label`."""
    what = f"{label}: writing {value_text(data)} to 0x{index:04X}:{subindex:02X}"
    begin = partial(protocol.download, index, subindex, data)
    return Transfer(begin, index, subindex, what, timeout_s, data, permitted)


def value_text(data: bytes) -> str:
    """Return bytes as a number where they can be one: `5000 (88 13)`."""
    number = f"{int.from_bytes(data, 'little')} " if len(data) in (1, 2, 4, 8) else ""
    return f"{number}({data[:16].hex(' ')}{' …' if len(data) > 16 else ''})"
