"""`gwrms trace --load`: who takes the bus's time, a table a second."""

import dataclasses
import sys
from collections.abc import Callable, Iterator, Mapping

import msgspec

from drivers.trace.files import Captured
from drivers.trace.load import Load, Meter
from drivers.trace.sources import Batch

SECOND_NS = 10**9

NamesOf = Callable[[str], Mapping[int, str]]  # of the nodes on an interface


class Meters:
    """One meter a bus; `bitrates` in bit/s by interface, `usual` for others."""

    def __init__(self, bitrates: Mapping[str, int | None], usual: int | None) -> None:
        self._usual = usual
        self._by_interface = {name: Meter(bitrate) for name, bitrate in bitrates.items()}

    def take(self, captured: Captured) -> None:
        """Count one frame."""
        meter = self._by_interface.setdefault(captured.interface, Meter(self._usual))
        meter.take(captured)

    def told(self, seconds: float) -> dict[str, Load]:
        """Return the load since the last call, `seconds` ago, by interface, and begin anew."""
        return {name: meter.told(seconds) for name, meter in self._by_interface.items()}


def show_load(batches: Iterator[Batch], meters: Meters, names: NamesOf, *, as_json: bool) -> None:
    """Print a table a bus for each second, and for what is left at the end of a recording."""
    began_ns: int | None = None
    now_ns, is_recorded = 0, True
    for batch in batches:
        now_ns, is_recorded = batch.now_ns, not batch.live
        if began_ns is None:
            began_ns = now_ns
            if batch.live:  # what has waited for us is not of this second
                continue
        if now_ns - began_ns >= SECOND_NS:
            _print(meters.told((now_ns - began_ns) / 1e9), names, as_json=as_json)
            began_ns = now_ns
        for captured in batch.frames:
            meters.take(captured)
    if is_recorded and began_ns is not None and now_ns > began_ns:
        _print(meters.told((now_ns - began_ns) / 1e9), names, as_json=as_json)


def _print(loads: Mapping[str, Load], names: NamesOf, *, as_json: bool) -> None:
    for interface, load in loads.items():
        head = [f"{interface}:"] if len(loads) > 1 else []
        lines = [_json(interface, load)] if as_json else [*head, *table(load, names(interface)), ""]
        sys.stdout.write("\n".join(lines) + "\n")
    sys.stdout.flush()


def _json(interface: str, load: Load) -> str:
    return msgspec.json.encode({"interface": interface or None, **dataclasses.asdict(load)}).decode()


def table(load: Load, names: Mapping[int, str]) -> Iterator[str]:
    """Yield the shares, the most first, and their sum."""
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
