"""The robot's computer as its files tell it, and mistakes in how it is set up."""

import os
from collections.abc import Iterable, Mapping
from pathlib import Path

from hil_sim.mistakes.mistake import Mistake

FOLDER = "computer"
_GOVERNOR = "sys/devices/system/cpu/cpu{}/cpufreq/scaling_governor"
_QUEUE = "sys/class/net/sim/tx_queue_len"
_LATENCY = "sys/bus/usb-serial/devices/{}/latency_timer"
_SYNCHRONISED = "run/systemd/timesync/synchronized"
_LIMITS = "proc/self/limits"
_LIMIT = (
    "Limit                     Soft Limit           Hard Limit\nMax realtime priority     {0}       {0}\n"
)
_EVERY_PORT = "*"

_WELL: Mapping[str, str] = {
    _GOVERNOR.format(0): "performance\n",
    _GOVERNOR.format(1): "performance\n",
    _QUEUE: "1000\n",
    _LATENCY.format(_EVERY_PORT): "1\n",
    _SYNCHRONISED: "",
    _LIMITS: _LIMIT.format(99),
    "proc/self/status": "Name:\tgwrms\nCapEff:\t0000000000000000\n",
}

MISTAKES = {
    "latency_timer": Mistake(
        "The USB serial adapters gather bytes for 16 ms.", computer={_LATENCY.format(_EVERY_PORT): "16\n"}
    ),
    "clock": Mistake("Nobody sets the computer's clock.", computer={_SYNCHRONISED: None}),
    "governor": Mistake(
        "The computer's cores save power.",
        computer={_GOVERNOR.format(0): "powersave\n", _GOVERNOR.format(1): "powersave\n"},
    ),
    "realtime": Mistake("The computer allows no real-time priority.", computer={_LIMITS: _LIMIT.format(0)}),
    "txqueuelen": Mistake("The CAN interface has room for ten frames.", computer={_QUEUE: "10\n"}),
}


def write(folder: Path, ports: Iterable[Path], mistakes: Iterable[Mistake]) -> Path:
    """Write the computer's files below `folder`, for an adapter behind each port; returns where."""
    root = folder / FOLDER
    files: dict[str, str | None] = dict(_WELL)
    for mistake in mistakes:
        files |= mistake.computer
    names = [os.path.realpath(port).removeprefix("/dev/").replace("/", "!") for port in ports]
    for path, content in files.items():
        for name in names if _EVERY_PORT in path else [""]:
            _put(root / path.replace(_EVERY_PORT, name), content)
    (root / "run").mkdir(parents=True, exist_ok=True)
    return root


def _put(file: Path, content: str | None) -> None:
    file.unlink(missing_ok=True)
    if content is not None:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(content, encoding="utf-8")
