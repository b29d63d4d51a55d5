"""Streams: channels as they come."""

from typing import Annotated, Final, Literal

from msgspec import Meta, Struct

from gateway.wire.method import Done, Globs, Method, Params
from gateway.wire.role import Role

ModuleName = Literal["component", "status", "resource"]


class StreamStartParams(Params, frozen=True):
    """`stream.start`; `rate_hz` 0 sends every source's own samples."""

    modules: Annotated[list[ModuleName], Meta(min_length=1)]
    rate_hz: Annotated[float, Meta(ge=0, le=1000)]
    channels: Globs | None = None


class StreamStarted(Struct, frozen=True):
    """Result of `stream.start`."""

    stream: int


class StreamStopParams(Params, frozen=True):
    """`stream.stop`."""

    stream: int


class StreamData(Struct, frozen=True):
    """Parameters of the notification `stream.data`: row i of every column was taken at `stamp_ns[i]`."""

    stream: int
    seq: int
    dropped: int
    stamp_ns: list[int]
    columns: dict[str, list[float | None]]
    shed: int = 1  # one row of so many was sent, because the gateway keeps to `max_cpu_percent`


STREAM_DATA: Final = "stream.data"  # the notification
STREAM_START = Method("stream.start", StreamStartParams, StreamStarted, role=Role.VIEWER)
STREAM_STOP = Method("stream.stop", StreamStopParams, Done, role=Role.VIEWER)
METHODS = (STREAM_START, STREAM_STOP)
