"""Mapping of channels to ROS 2 topics, and of rows to messages."""

import functools
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from ml.store.sessions import Channel
from server_gui.core.cloud.ros import header

Values = Mapping[str, float | None]
Message = dict[str, Any]

JOINT: Final = {"position": "rad", "velocity": "rad/s", "torque": "N·m"}  # as JointState has them
IMU: Final = {  # a message's field → how the channels begin, and their axes
    "orientation": ("orientation", "xyzw"),
    "angular_velocity": ("angular_velocity", "xyz"),
    "linear_acceleration": ("acceleration", "xyz"),
}
BY_UNIT: Final = {  # one value, with a header
    "Pa": ("sensor_msgs/FluidPressure", "fluid_pressure"),
    "°C": ("sensor_msgs/Temperature", "temperature"),
}
_UNKNOWN: Final = [-1.0, *[0.0] * 8]  # sensor_msgs/Imu: "no estimate for one of the data elements"
_NO_COVARIANCE: Final = [0.0] * 9  # the same: "covariance unknown"
_CELL: Final = re.compile(r"(.+)\.cell_(\d+)")


@dataclass(frozen=True, slots=True)
class Topic:
    """A topic, its message's kind, the channels in it, and what makes a message of their values."""

    name: str
    kind: str
    channels: Sequence[str]
    message: Callable[[int, Values], Message]


def topics(robot: str, channels: Iterable[Channel]) -> list[Topic]:
    """Return every channel in one topic: joints, IMUs, insoles' cells, and what is left one by one."""
    root = f"/{ros_name(robot)}"
    left = {each.name: each.unit for each in channels}
    found = [*_joints(root, left), *_imus(root, left), *_cells(root, left)]
    return found + [_single(root, name, unit) for name, unit in left.items()]


def ros_name(name: str) -> str:
    """Make a topic's name of ours: letters, digits, _ and /; no part begins with a digit."""
    plain = re.sub(r"[^A-Za-z0-9_/]", "_", name.replace(".", "/"))
    return "/".join(f"_{part}" if part[:1].isdigit() else part for part in plain.split("/"))


def _joints(root: str, left: dict[str, str | None]) -> Iterator[Topic]:
    """Yield all joints in one message; takes their channels out of `left`, as the others do with theirs."""
    joints = [
        name.removesuffix(".position")
        for name, unit in left.items()
        if unit == JOINT["position"] and name.endswith(".position")
    ]
    columns = {
        field: [f"{joint}.{quantity}" for joint in joints]
        for field, quantity in zip(("position", "velocity", "effort"), JOINT, strict=True)
    }
    columns = {field: names for field, names in columns.items() if any(name in left for name in names)}

    def message(utc_ns: int, values: Values) -> Message:
        found: Message = {"header": header(utc_ns, ""), "name": joints}
        numbers = {field: [_number(values.get(name)) for name in names] for field, names in columns.items()}
        return found | {"position": [], "velocity": [], "effort": []} | numbers

    if joints:
        names = [name for of_field in columns.values() for name in of_field if name in left]
        yield Topic(f"{root}/joint_states", "sensor_msgs/JointState", _taken(left, names), message)


def _imus(root: str, left: dict[str, str | None]) -> Iterator[Topic]:
    """Yield a message an IMU."""
    beginnings = tuple(f".{quantity}_x" for quantity, _ in IMU.values())
    for imu in sorted({name.rpartition(".")[0] for name in left if name.endswith(beginnings)}):
        columns = {
            field: {axis: f"{imu}.{quantity}_{axis}" for axis in axes}
            for field, (quantity, axes) in IMU.items()
        }
        names = [name for axes in columns.values() for name in axes.values() if name in left]
        message = functools.partial(_imu, imu, columns)
        yield Topic(f"{root}/{ros_name(imu)}/imu", "sensor_msgs/Imu", _taken(left, names), message)


def _imu(imu: str, columns: Mapping[str, Mapping[str, str]], utc_ns: int, values: Values) -> Message:
    found: Message = {"header": header(utc_ns, imu)}
    for field, axes in columns.items():
        numbers = {axis: values.get(name) for axis, name in axes.items()}
        known = None not in numbers.values()
        found[field] = numbers if known else dict.fromkeys(axes, 0.0)
        found[f"{field}_covariance"] = _NO_COVARIANCE if known else _UNKNOWN
    return found


def _cells(root: str, left: dict[str, str | None]) -> Iterator[Topic]:
    """Yield a message an insole, with all its cells in their order."""
    cells: dict[str, dict[int, str]] = {}
    for name in left:
        if found := _CELL.fullmatch(name):
            cells.setdefault(found[1], {})[int(found[2])] = name
    for insole, numbered in sorted(cells.items()):
        names = [numbered[number] for number in sorted(numbered)]
        dimension = {"label": "cell", "size": len(names), "stride": len(names)}
        message = functools.partial(_array, {"dim": [dimension], "data_offset": 0}, names)
        name = f"{root}/{ros_name(insole)}/cells"
        yield Topic(name, "std_msgs/Float64MultiArray", _taken(left, names), message)


def _array(layout: Message, names: Sequence[str], _: int, values: Values) -> Message:
    return {"layout": layout, "data": [_number(values[name]) for name in names]}


def _single(root: str, name: str, unit: str | None) -> Topic:
    topic = f"{root}/{ros_name(name)}"
    if unit not in BY_UNIT:
        return Topic(topic, "std_msgs/Float64", (name,), lambda _, values: {"data": values[name]})
    kind, field = BY_UNIT[unit]
    frame_id = name.rpartition(".")[0]
    return Topic(
        topic,
        kind,
        (name,),
        lambda utc_ns, values: {"header": header(utc_ns, frame_id), field: values[name], "variance": 0.0},
    )


def _taken(left: dict[str, str | None], names: Sequence[str]) -> Sequence[str]:
    for name in names:
        left.pop(name)
    return names


def _number(value: float | None) -> float:
    return math.nan if value is None else value
