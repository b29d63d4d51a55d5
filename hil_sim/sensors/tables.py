"""The sensors' tables of the robot's file, and what must stand beside it, for every choice of sensors."""

from pathlib import Path

from hil_sim.sensors.cia410 import NODE_ID
from hil_sim.sensors.insole_frame import PASCAL_PER_COUNT
from hil_sim.sensors.suite import FEET, INSOLES, SERIAL_IMUS, TRUNK, SensorChoice
from hil_sim.sensors.witmotion_can import CAN_ID

_FIRST_INSOLE = """\
[insole.{name}]
port = "{folder}/{name}"   # a path that stays: for real ones /dev/serial/by-id/…
baudrate = {baudrate}
format = "{format}"          # how the insole talks
{more}"""

_INSOLE = """
[insole.{name}]           # the same for the other foot: the layout is mirrored
port = "{folder}/{name}"
baudrate = {baudrate}
format = "{format}"
{more}"""

_CALIBRATION = "insole-18.calibration.toml"
_INSOLE_MORE = {
    "insole-cobs": 'layout = "insole-16"            # where its cells are; or a .toml file of your own\n',
    "insole-csv": 'layout = "insole-8"             # its cells, what its columns are, a calibration\n',
    "insole-frame": (
        'layout = "insole-18"            # its cells, and how its frame is laid out\n'
        f'calibration = "{_CALIBRATION}"   # counts to pressure: gwrms calibrate insole writes one\n'
    ),
}

_CALIBRATION_TEXT = f"""\
# The simulated insole's converter: the same for every cell. A real one is measured: gwrms calibrate insole.
[default]
gain = {PASCAL_PER_COUNT}   # Pa a count
"""

_SERIAL_IMU = """
[imu.{name}]
port = "{folder}/{name}"
baudrate = {baudrate}
format = "{format}"
{axes}"""

_AXES = 'axes = ["x", "y", "z"]          # which sensor axes point forward, left and up along the trunk\n'
_AXES_DOWN = (
    'axes = ["x", "-y", "-z"]        # which sensor axes point forward, left and up along the trunk\n'
)

_CAN_IMU = f"""
[imu.{{name}}]
bus = "main"                    # the [can.…] table it is wired to
format = "witmotion-can"
can_id = 0x{CAN_ID:02X}                   # of its frames, as set in it
{_AXES}"""

_INCLINOMETER = f"""
[imu.{{name}}]
bus = "main"                    # the [can.…] table it is wired to
format = "cia410"               # an inclinometer: tilt, and nothing else
node_id = {NODE_ID}
directions = [1, 1]             # of its x and y axis: 1 where positive means that it points below the horizon
{_AXES}"""

_BUS_IMUS = {"witmotion-can": _CAN_IMU, "cia410": _INCLINOMETER}


def tables(choice: SensorChoice, folder: Path) -> str:
    """`[insole.…]` and `[imu.…]` for the simulator in `folder`."""
    serial = INSOLES[choice.insole][0]
    facts = {"folder": folder, "baudrate": serial.baudrate, "format": choice.insole}
    feet = (
        template.format(name=name, more=_INSOLE_MORE[choice.insole], **facts)
        for template, name in zip((_FIRST_INSOLE, _INSOLE), FEET, strict=True)
    )
    return "".join((*feet, _imu_table(choice.imu, folder)))


def companions(choice: SensorChoice) -> dict[str, str]:
    """Names and contents of the files that the tables name."""
    return {_CALIBRATION: _CALIBRATION_TEXT} if choice.insole == "insole-frame" else {}


def _imu_table(language: str, folder: Path) -> str:
    if language in _BUS_IMUS:
        return _BUS_IMUS[language].format(name=TRUNK)
    format_name, _, _ = language.partition("-binary")
    return _SERIAL_IMU.format(
        name=TRUNK,
        folder=folder,
        baudrate=SERIAL_IMUS[language].baudrate,
        format=format_name,
        axes=_AXES_DOWN if format_name == "vectornav" else _AXES,
    )
