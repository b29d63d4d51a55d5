"""The held stop on disk: written when a stop is held, removed by its reset, found by the next gateway."""

import logging
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import msgspec

from gateway.records import durable

log = logging.getLogger(__name__)


class HeldStop(msgspec.Struct, frozen=True):
    """A stop that is held: who asked for it and why, and when, on the clock of which boot."""

    who: str
    reason: str
    utc_ns: int
    monotonic_ns: int
    boot_id: str


class HoldFile:
    """Its own thread writes, so that no disk delays a stop; where that fails, the future says why."""

    def __init__(self, path: Path, unusable: str | None) -> None:
        self._path = path
        self._unusable = unusable
        self._writer = ThreadPoolExecutor(max_workers=1, thread_name_prefix="hold")

    def load(self) -> HeldStop | None:
        """What the last gateway left; a file that cannot be read is a held stop of unknown reason."""
        try:
            return msgspec.json.decode(self._path.read_bytes(), type=HeldStop)
        except (FileNotFoundError, NotADirectoryError):
            return None
        except (OSError, msgspec.DecodeError) as error:
            log.error("%s cannot be read (%s): the stop is held", self._path, error)
            return HeldStop("unknown", f"{self._path.name} cannot be read: {error}", 0, 0, "")

    def write(self, held: HeldStop) -> "Future[None]":
        """Keep it; fails with `OSError`."""
        return self._writer.submit(self._write, msgspec.json.encode(held))

    def remove(self) -> "Future[None]":
        """Keep it no longer; fails with `OSError`."""
        return self._writer.submit(durable.remove, self._path)

    def close(self) -> None:
        """Write what was asked for, and end."""
        self._writer.shutdown(wait=True)

    def _write(self, data: bytes) -> None:
        if self._unusable is not None:
            raise OSError(None, self._unusable)
        durable.write(self._path, data)
