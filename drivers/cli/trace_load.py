"""`gwrms trace --load`: who takes the bus's time, a table a second."""

import sys
from collections.abc import Iterator, Mapping

import msgspec

from drivers.trace.load import Load, Meter
from drivers.trace.sources import Batch

SECOND_NS = 10**9


def show_load(batches: Iterator[Batch], meter: Meter, names: Mapping[int, str], *, as_json: bool) -> None:
    """Print a table for each second, and for what is left at the end of a recording."""
    began_ns: int | None = None
    now_ns, is_recorded = 0, True
    for batch in batches:
        now_ns, is_recorded = batch.now_ns, not batch.live
        if began_ns is None:
            began_ns = now_ns
            if batch.live:  # what has waited for us is not of this second
                continue
        if now_ns - began_ns >= SECOND_NS:
            _print(meter.told((now_ns - began_ns) / 1e9), names, as_json=as_json)
            began_ns = now_ns
        for captured in batch.frames:
            meter.take(captured)
    if is_recorded and began_ns is not None and now_ns > began_ns:
        _print(meter.told((now_ns - began_ns) / 1e9), names, as_json=as_json)


def _print(load: Load, names: Mapping[int, str], *, as_json: bool) -> None:
    lines = [msgspec.json.encode(load).decode()] if as_json else [*table(load, names), ""]
    sys.stdout.write("\n".join(lines) + "\n")
    sys.stdout.flush()


def table(load: Load, names: Mapping[int, str]) -> Iterator[str]:
    """The shares, the most first, and their sum."""
    yield f"{'NODE':<14} {'KIND':<12} {'FRAMES/S':>9} {'kbit/s':>8} {'LOAD':>7}"
    for share in load.shares:
        node = "" if share.node_id is None else names.get(share.node_id, f"node {share.node_id}")
        rates = f"{share.frames_per_s:>9.1f} {share.bits_per_s / 1000:>8.1f} {_percent(share.percent):>7}"
        yield f"{node:<14} {share.kind:<12} {rates}"
    bits = sum(share.bits_per_s for share in load.shares)
    total = f"{load.frames_per_s:>9.1f} {bits / 1000:>8.1f} {_percent(load.percent):>7}"
    yield f"{'all':<14} {'':<12} {total}"
    if load.error_frames:
        frames = "error frame" if load.error_frames == 1 else "error frames"
        yield f"{load.error_frames} {frames}: check termination, wiring and bit rate"


def _percent(value: float | None) -> str:
    return "–" if value is None else f"{value:.1f} %"
