"""`gwrms snapshot`: take a snapshot of resources, components or status."""

import argparse
import time
from collections.abc import Iterator

import msgspec

from gateway.amounts import NONE, age, percent, size
from gateway.cli.connect import UnknownName, channel_names, check_names, connect, parser, widened
from gateway.cli.text import exact, measured, say, say_json, table
from gateway.client import Robot
from gateway.wire.component import QualityInfo, Snapshot
from gateway.wire.resource import ControlProcess, ResourceSnapshot, ResourceSnapshotParams
from gateway.wire.robot import Description

BETWEEN_LOOKS_S = 0.5  # what CPU percentages are taken over
INCLUDE = ("disk", "network", "thermal", "kernel", "cmdline", "control")

EPILOG = """examples:
  gwrms snapshot resource --sort memory --limit 10
  gwrms snapshot component 'left_*.position' trunk.tilt_forward
  gwrms snapshot status --json"""


def main(argv: list[str]) -> int:
    """Run `gwrms snapshot`."""
    arguments = _parse(argv)
    with connect(arguments, "snapshot") as robot:
        if arguments.module == "resource":
            return _resource(robot, arguments)
        return _values(robot, arguments)


def _parse(argv: list[str]) -> argparse.Namespace:
    made = parser("snapshot", "Take a snapshot of a robot.", EPILOG)
    made.add_argument("module", choices=("resource", "component", "status"), help="the module")
    made.add_argument(
        "channels", metavar="GLOB", nargs="*", default=[], help="component: only these channels"
    )
    group = made.add_argument_group("resource")
    group.add_argument("--sort", choices=("cpu", "memory", "name", "pid"), default="cpu", help="default: cpu")
    order = group.add_mutually_exclusive_group()
    order.add_argument("--ascending", dest="descending", action="store_const", const=False)
    order.add_argument("--descending", dest="descending", action="store_const", const=True)
    group.add_argument("--limit", type=_count, metavar="N", help="only the first N processes")
    group.add_argument(
        "--include", choices=INCLUDE, action="append", default=[], help="include more; repeatable"
    )
    arguments = made.parse_args(argv)
    if arguments.channels and arguments.module != "component":
        made.error(f"{arguments.module} takes no channels")
    return arguments


def _count(text: str) -> int:
    if not (text.isascii() and text.isdigit()):
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of processes")
    return int(text)


def _resource(robot: Robot, arguments: argparse.Namespace) -> int:
    params = ResourceSnapshotParams(
        include=arguments.include,
        sort=arguments.sort,
        descending=arguments.descending,
        limit=arguments.limit,
    )
    # Percentages are over the time since this connection's last request, so the first look only begins it.
    robot.resources(params)
    time.sleep(BETWEEN_LOOKS_S)
    snapshot = robot.resources(params)
    if arguments.json:
        say_json(snapshot)
    else:
        say(_resource_text(snapshot))
    return 0


def _resource_text(snapshot: ResourceSnapshot) -> str:
    facts = "".join(f"{name:<8} {text}\n" for name, text in _facts(snapshot))
    if isinstance(snapshot.control, list):
        facts += "\n" + _control_text(snapshot.control)
    if not isinstance(snapshot.processes, list):
        return facts
    rows = [
        (str(found.pid), percent(found.cpu_percent), size(found.memory_bytes), found.cmdline or found.name)
        for found in snapshot.processes
    ]
    return facts + "\n" + table(("PID", "CPU", "MEMORY", "NAME"), rows, right=(0, 1, 2))


def _control_text(processes: list[ControlProcess]) -> str:
    header = ("THREAD", "OF", "CPU", "WAITED", "POLICY", "CORE", "SWITCHES/S", "FORCED/S")
    rows = [
        (
            f"{one.name} ({one.tid})",
            f"{process.name} ({process.pid})",
            percent(one.cpu_percent),
            percent(one.wait_percent),
            f"{one.policy} {one.priority}",
            str(one.core),
            exact(one.switches_per_s),
            exact(one.forced_switches_per_s),
        )
        for process in processes
        for one in process.threads
    ]
    lines = [
        f"{process.name} ({process.pid}): page faults {exact(process.minor_faults_per_s)}/s, "
        f"from disk {exact(process.major_faults_per_s)}/s, "
        f"read {_per_s(process.read_bytes_per_s)}, written {_per_s(process.write_bytes_per_s)}\n"
        for process in processes
    ]
    return table(header, rows, right=(2, 3, 5, 6, 7)) + "".join(lines)


def _per_s(count: float | None) -> str:
    return NONE if count is None else f"{size(count)}/s"


def _facts(snapshot: ResourceSnapshot) -> Iterator[tuple[str, str]]:
    cpu, memory = snapshot.cpu, snapshot.memory
    cores = ", ".join(percent(core) for core in cpu.per_core)
    load = " ".join(f"{average:.2f}" for average in cpu.load)
    yield "CPU", f"{percent(cpu.percent)} of {len(cpu.per_core)} cores ({cores}), load {load}"
    used, total, available = size(memory.used), size(memory.total), size(memory.available)
    yield "memory", f"{used} used of {total}, {available} available, swap {size(memory.swap_used)}"
    yield "gateway", f"{percent(snapshot.gateway.cpu_percent)} of a core, {size(snapshot.gateway.rss_bytes)}"
    # What --include asked for, as the robot names it.
    for name in ("disk", "network", "thermal", "throttling", "kernel"):
        found = getattr(snapshot, name)
        if found is not msgspec.UNSET:
            known = msgspec.to_builtins(found).items()
            yield (
                name,
                ", ".join(
                    f"{key} {value:.1f}" if isinstance(value, float) else f"{key} {value}"
                    for key, value in known
                ),
            )


def _values(robot: Robot, arguments: argparse.Namespace) -> int:
    description = robot.describe()
    names = [name for name in channel_names(description) if not name.startswith("resource.")]
    channels = widened(arguments.channels, description)
    for glob in channels:
        if glob.startswith("resource."):
            raise UnknownName(
                f"{glob} is the computer's own: ask gwrms snapshot resource, or gwrms watch {glob!r}"
            )
    check_names("channel", channels, names)
    snapshot = robot.components(*channels) if arguments.module == "component" else robot.status()
    if arguments.json:
        say_json(snapshot)
    else:
        say(_values_text(snapshot, description))
    return 0


def _values_text(snapshot: Snapshot, description: Description) -> str:
    channels = {channel.name: channel for channel in description.channels}
    rows = []
    for name, value in snapshot.values.items():
        channel = channels.get(name)
        stamp_ns = snapshot.stamps_ns.get(name)
        old_s = None if stamp_ns is None else (snapshot.stamp_ns - stamp_ns) / 1e9
        unit = channel.unit if channel is not None else ""
        rows.append((name, measured(value, channel), unit, age(old_s)))
    quality = [(name, *_quality(found)) for name, found in snapshot.quality.items()]
    return (
        table(("CHANNEL", "VALUE", "UNIT", "AGE"), rows, right=(1, 3))
        + "\n"
        + table(("COMPONENT", "STATE", "AGE", "PROBLEM"), quality, right=(2,))
    )


def _quality(found: QualityInfo) -> tuple[str, str, str]:
    age_ms = found.get("age_ms")
    seconds = age_ms / 1000 if isinstance(age_ms, int | float) else None
    return str(found.get("state", NONE)), age(seconds), str(found.get("problem") or "")
