"""The ROS 2 messages that exports are made of; definitions as common_interfaces has them (Apache-2.0)."""

from typing import Any, Final

_RULE: Final = "=" * 80
_OWN: Final = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec\n",
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
    "std_msgs/Float64": "float64 data\n",
    "std_msgs/String": "string data\n",
    "std_msgs/MultiArrayDimension": "string label\nuint32 size\nuint32 stride\n",
    "std_msgs/MultiArrayLayout": "MultiArrayDimension[] dim\nuint32 data_offset\n",
    "std_msgs/Float64MultiArray": "MultiArrayLayout layout\nfloat64[] data\n",
    "geometry_msgs/Quaternion": "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z\n",
    "sensor_msgs/JointState": (
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n"
    ),
    "sensor_msgs/Imu": (
        "std_msgs/Header header\n"
        "geometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
        "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
        "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n"
    ),
    "sensor_msgs/FluidPressure": "std_msgs/Header header\nfloat64 fluid_pressure\nfloat64 variance\n",
    "sensor_msgs/Temperature": "std_msgs/Header header\nfloat64 temperature\nfloat64 variance\n",
    "diagnostic_msgs/KeyValue": "string key\nstring value\n",
    "diagnostic_msgs/DiagnosticStatus": (
        "byte OK=0\nbyte WARN=1\nbyte ERROR=2\nbyte STALE=3\n"
        "byte level\nstring name\nstring message\nstring hardware_id\nKeyValue[] values\n"
    ),
    "diagnostic_msgs/DiagnosticArray": "std_msgs/Header header\nDiagnosticStatus[] status\n",
}
_USES: Final[dict[str, tuple[str, ...]]] = {  # further definitions that a message needs, all the way down
    "std_msgs/Float64MultiArray": ("std_msgs/MultiArrayLayout", "std_msgs/MultiArrayDimension"),
    "sensor_msgs/JointState": ("std_msgs/Header", "builtin_interfaces/Time"),
    "sensor_msgs/FluidPressure": ("std_msgs/Header", "builtin_interfaces/Time"),
    "sensor_msgs/Temperature": ("std_msgs/Header", "builtin_interfaces/Time"),
    "sensor_msgs/Imu": (
        "std_msgs/Header",
        "builtin_interfaces/Time",
        "geometry_msgs/Quaternion",
        "geometry_msgs/Vector3",
    ),
    "diagnostic_msgs/DiagnosticArray": (
        "std_msgs/Header",
        "builtin_interfaces/Time",
        "diagnostic_msgs/DiagnosticStatus",
        "diagnostic_msgs/KeyValue",
    ),
}


def definition(kind: str) -> str:
    """Everything that a reader without ROS needs to decode a message of this kind, `package/Name`."""
    parts = [_OWN[kind], *(f"{_RULE}\nMSG: {used}\n{_OWN[used]}" for used in _USES.get(kind, ()))]
    return "".join(parts)


def header(utc_ns: int, frame_id: str) -> dict[str, Any]:
    """Return a `std_msgs/Header`."""
    sec, nanosec = divmod(utc_ns, 1_000_000_000)
    return {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": frame_id}
