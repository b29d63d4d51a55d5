"""Properties read from a drive when it comes up: mapping, ratings, option codes."""

from collections.abc import Mapping
from dataclasses import dataclass

from drivers.bus.pdo import Tpdo, read_tpdos
from drivers.bus.sdo.channel import SdoChannel
from drivers.bus.values import decode
from drivers.errors import DeviceAbort
from drivers.joint.quantities import AXIS_OFFSET
from drivers.joint.scaling import SCALING_OBJECTS
from eds import Description
from eds.profile import profile_of

OPTION_OBJECTS: dict[str, tuple[int, int]] = {"quick_stop": (0x605A, 0), "abort_connection": (0x6007, 0)}


@dataclass(frozen=True, slots=True)
class DriveReading:
    """One reading of one axis. A number is `None` where the device has no such object."""

    tpdos: tuple[Tpdo, ...]
    scaling: Mapping[str, float | None]  # by the names of SCALING_OBJECTS
    options: Mapping[str, int | None]  # by the names of OPTION_OBJECTS


def read_drive(sdo: SdoChannel, description: Description, axis: int) -> DriveReading:
    """Ask the drive; raises `DriverError` where it stays silent."""
    return DriveReading(
        tpdos=read_tpdos(sdo, description),
        scaling=_in_usual_units(_read_all(sdo, description, SCALING_OBJECTS, axis), description),
        options=_read_all(sdo, description, OPTION_OBJECTS, axis),
    )


def _in_usual_units(
    scaling: Mapping[str, int | None], description: Description
) -> Mapping[str, float | None]:
    """Rated values as CiA 402 has them, also of a product that counts otherwise."""
    profile, torque = profile_of(description), scaling["rated_torque_mnm"]
    if profile is None or torque is None:
        return scaling
    return {**scaling, "rated_torque_mnm": torque * profile.rated_torque_nm * 1000}


def _read_all(
    sdo: SdoChannel, description: Description, objects: Mapping[str, tuple[int, int]], axis: int
) -> dict[str, int | None]:
    offset = axis * AXIS_OFFSET
    return {name: _read(sdo, description, index + offset, sub) for name, (index, sub) in objects.items()}


def _read(sdo: SdoChannel, description: Description, index: int, subindex: int) -> int | None:
    variable = description.variable(index, subindex)
    if variable is None:
        return None
    try:
        value = decode(sdo.upload(index, subindex), variable.data_type or 0)
    except DeviceAbort:
        return None
    return None if value is None else int(value)
