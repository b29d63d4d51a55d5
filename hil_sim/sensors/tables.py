"""The sensors' tables of the robot's file, and what must stand beside it, for every choice of sensors."""

from collections.abc import Mapping
from pathlib import Path

from hil_sim.sensors.suite import BUS_IMUS, FEET, INSOLES, SERIAL_IMUS, TRUNK, SensorChoice

_FIRST_INSOLE = """\
[insole.{name}]
port = "{folder}/{name}"   # a path that stays: for real ones /dev/serial/by-id/…
baudrate = {baudrate}
format = "{format}"          # how the insole talks
{keys}"""

_INSOLE = """
[insole.{name}]           # the same for the other foot: the layout is mirrored
port = "{folder}/{name}"
baudrate = {baudrate}
format = "{format}"
{keys}"""

_SERIAL_IMU = """
[imu.{name}]
port = "{folder}/{name}"
baudrate = {baudrate}
format = "{format}"
{keys}"""

_BUS_IMU = """
[imu.{name}]
bus = "main"                    # the [can.…] table it is wired to
{keys}"""


def tables(choice: SensorChoice, folder: Path) -> str:
    """`[insole.…]` and `[imu.…]` for the simulator in `folder`."""
    language = INSOLES[choice.insole][0]
    facts = {"folder": folder, "baudrate": language.baudrate, "format": choice.insole, "keys": language.keys}
    templates = zip((_FIRST_INSOLE, _INSOLE), FEET, strict=True)
    feet = (template.format(name=name, **facts) for template, name in templates)
    return "".join((*feet, _imu_table(choice.imu, folder)))


def companions(choice: SensorChoice) -> Mapping[str, str]:
    """Return names and contents of the files that the tables name."""
    return INSOLES[choice.insole][0].beside


def _imu_table(language: str, folder: Path) -> str:
    if language in BUS_IMUS:
        return _BUS_IMU.format(name=TRUNK, keys=BUS_IMUS[language].keys)
    return _SERIAL_IMU.format(
        name=TRUNK,
        folder=folder,
        baudrate=SERIAL_IMUS[language].baudrate,
        format=language.removesuffix("-binary"),
        keys=SERIAL_IMUS[language].keys,
    )
