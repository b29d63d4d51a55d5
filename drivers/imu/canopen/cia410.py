"""Format `cia410`: a two-axis inclinometer (CiA 410), whose slopes are the trunk's tilt."""

from typing import TYPE_CHECKING, Annotated, Literal

import msgspec

import eds
from drivers.imu.format import NodeFormat
from drivers.imu.settings import NodeImuSettings

if TYPE_CHECKING:
    from drivers.build_context import BuildContext
    from drivers.imu.inclinometer import Inclinometer

Sign = Literal[1, -1]


class InclinometerSettings(NodeImuSettings, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One two-axis inclinometer on a CANopen bus (CiA 410)."""

    directions: tuple[Sign, Sign] = (
        1,
        1,
    )  # of its x and y axis; 1: positive when it points below the horizon
    poll_hz: Annotated[float, msgspec.Meta(ge=0, le=200)] = 20.0  # slopes that no TPDO brings; 0: never


def build(name: str, settings: InclinometerSettings, site: "BuildContext") -> "Inclinometer":
    """Build it; raises `SettingsError` and `EdsError` for unusable settings or device files."""
    from drivers.imu.inclinometer import Inclinometer  # needs what only a started bus needs

    description = eds.load(eds.locate(settings.eds, site.file), settings.node_id)
    imu = Inclinometer(name, settings, site.buses[settings.bus], description, site.folder)
    site.descriptions[name] = description
    return imu


FORMAT = NodeFormat(build, InclinometerSettings)
