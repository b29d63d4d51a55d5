"""The robot's computer as /sys and /proc tell it; another `root` is a copy of another computer's."""

import os
from collections.abc import Iterable, Iterator
from pathlib import Path

from drivers.bus.settings import CanSettings
from drivers.realtime_priority import PRIORITY
from gateway.config.robot import RobotConfig
from gateway.doctor.observations import Computer
from gateway.modules.resource.extras import kernel

ROOT = Path("/")
_CAP_SYS_NICE = 23
_RT_LIMIT = "Max realtime priority"
_UNLIMITED = "unlimited"


def computer(config: RobotConfig, root: Path = ROOT) -> Computer:
    """Return the facts about this computer; unknown ones are `None` or missing."""
    names = {link for settings in config.can.values() if (link := links(settings)) is not None}
    paths = {sensor.port for _, sensor in config.on_ports()}
    return Computer(
        governors=_governors(root),
        realtime_allowed=_realtime(root),
        clock_synchronised=_synchronised(root),
        queue_lengths=dict(_numbers(root / "sys/class/net", names, "tx_queue_len")),
        latency_ms=dict(_numbers(root / "sys/bus/usb-serial/devices", map(usb_name, paths), "latency_timer")),
        missing_ports=frozenset(path for path in paths if root == ROOT and not Path(path).exists()),
        why_none="its /sys and /proc do not tell" if root == Path("/") else f"{root} does not tell",
    )


def links(settings: CanSettings) -> str | None:
    """Return the network interface of this computer that a bus is on.

    `None` where it is no such, or elsewhere.
    """
    if settings.interface == "socketcan":
        return str(settings.channel)
    if settings.interface == "socketcand" and settings.network is None:
        return str(settings.channel)  # of the daemon on this computer
    return None


def usb_name(port: str) -> str:
    """Return sysfs's name of the device behind a port, `ttyUSB0`; a slash in it is written `!`."""
    real = os.path.realpath(port)
    return real.removeprefix("/dev/").replace("/", "!")


def _numbers(folder: Path, names: Iterable[str], file: str) -> Iterator[tuple[str, int]]:
    for name in names:
        text = _text(folder / name / file)
        if text is not None and text.isdecimal():
            yield name, int(text)


def _governors(root: Path) -> tuple[str, ...] | None:
    files = sorted(root.glob("sys/devices/system/cpu/cpu[0-9]*/cpufreq/scaling_governor"))
    return tuple(text for file in files if (text := _text(file)) is not None) or None


def _realtime(root: Path) -> bool | None:
    limits, status = _text(root / "proc/self/limits"), _text(root / "proc/self/status")
    if limits is None or status is None:
        return None
    soft = next((line.split()[3] for line in limits.splitlines() if line.startswith(_RT_LIMIT)), "0")
    able = next((line.split()[1] for line in status.splitlines() if line.startswith("CapEff")), "0")
    return soft == _UNLIMITED or int(soft) >= PRIORITY or bool(int(able, 16) >> _CAP_SYS_NICE & 1)


def _synchronised(root: Path) -> bool | None:
    if root == ROOT:
        return kernel().utc_synchronised
    run = root / "run"
    return (run / "systemd/timesync/synchronized").exists() if run.is_dir() else None


def _text(file: Path) -> str | None:
    try:
        return file.read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError):
        return None
