"""Optional parts of a snapshot: disks, network, temperatures, throttling, kernel, clock."""

import ctypes
import platform
import time
from collections.abc import Iterator
from pathlib import Path

import psutil

from gateway.wire.resource import KernelFacts, Throttling

SYS = Path("/sys")
_SLOWING = (
    "thermal-cpufreq",
    "thermal-cpuidle",
    "cpufreq",
    "processor",
    "intel_powerclamp",
)  # cooling devices
_TIMEX_BYTES = 512  # more than any system's struct timex; modes 0 only reads
_TIME_ERROR = 5  # of adjtimex(2): the clock is not synchronised


def disk() -> tuple[int, int] | None:
    """Return bytes read and written since boot, over all disks."""
    counters = psutil.disk_io_counters()
    return None if counters is None else (counters.read_bytes, counters.write_bytes)


def network() -> tuple[int, int]:
    """Return bytes received and sent since boot, over all interfaces."""
    counters = psutil.net_io_counters()
    return counters.bytes_recv, counters.bytes_sent


def thermal() -> dict[str, float | None]:
    """Sensor → °C."""
    read = getattr(psutil, "sensors_temperatures", None)  # not on every system
    if read is None:
        return {}
    return {
        f"{chip}.{sensor.label or number}": sensor.current
        for chip, sensors in read().items()
        for number, sensor in enumerate(sensors)
    }


def throttling(root: Path = SYS) -> Throttling:
    """Return whether the cores are held back; `root` is where sysfs is mounted."""
    counts = [
        int(text)
        for file in root.glob("devices/system/cpu/cpu*/thermal_throttle/core_throttle_count")
        if (text := _text(file)) is not None
    ]
    frequencies = [
        _share(folder / "scaling_cur_freq", folder / "cpuinfo_max_freq")
        for folder in sorted(root.glob("devices/system/cpu/cpufreq/policy*"))
    ]
    return Throttling(sum(counts) if counts else None, dict(_cooling(root)), frequencies)


def _cooling(root: Path) -> Iterator[tuple[str, float]]:
    for folder in sorted(root.glob("class/thermal/cooling_device*")):
        kind = _text(folder / "type") or ""
        share = _share(folder / "cur_state", folder / "max_state")
        if kind.lower().startswith(_SLOWING) and share is not None:
            yield f"{kind}.{folder.name.removeprefix('cooling_device')}", share


def kernel(root: Path = SYS) -> KernelFacts:
    """Return the kernel, and what its clocks are worth; `root` is where sysfs is mounted."""
    facts = platform.uname()
    preempt_rt: bool | None = None
    if facts.system == "Linux":
        preempt_rt = "PREEMPT_RT" in facts.version or _text(root / "kernel/realtime") == "1"
    return KernelFacts(
        system=facts.system,
        release=facts.release,
        version=facts.version,
        preempt_rt=preempt_rt,
        clocksource=_text(root / "devices/system/clocksource/clocksource0/current_clocksource"),
        monotonic_resolution_ns=round(time.get_clock_info("monotonic").resolution * 1e9),
        utc_synchronised=_utc_synchronised(),
    )


def _utc_synchronised() -> bool | None:
    adjtimex = getattr(ctypes.CDLL(None), "adjtimex", None)  # Linux's
    state = -1 if adjtimex is None else adjtimex(ctypes.create_string_buffer(_TIMEX_BYTES))
    return None if state < 0 else state != _TIME_ERROR


def _share(part: Path, of: Path) -> float | None:
    numerator, denominator = _text(part) or "", _text(of) or ""
    if not (numerator.isdecimal() and denominator.isdecimal() and int(denominator)):  # `<unknown>`, too
        return None
    return int(numerator) / int(denominator)


def _text(file: Path) -> str | None:
    try:
        return file.read_text(encoding="utf-8").strip()
    except OSError:
        return None
