"""The component that a table `[imu.NAME]` of the robot's file means."""

from collections.abc import Mapping
from pathlib import Path

import eds
from drivers.bus.bus import CanBus
from drivers.imu.can_device import CanImu
from drivers.imu.device import Imu
from drivers.imu.inclinometer import Inclinometer
from drivers.imu.settings import CanImuSettings, ImuSettings, InclinometerSettings, MountedSettings

AnyImu = Imu | CanImu | Inclinometer


def build_imu(name: str, settings: MountedSettings, buses: Mapping[str, CanBus], path: Path) -> AnyImu:
    """The IMU that `settings` describe; files that they name are looked for beside `path`.

    Raises:
        SettingsError: they contradict themselves or the device's file.
        EdsError: the device's file is not there or cannot be used.

    """
    if isinstance(settings, ImuSettings):
        return Imu(name, settings, path.parent)
    if isinstance(settings, CanImuSettings):
        return CanImu(name, settings, buses[settings.bus], path.parent)
    if isinstance(settings, InclinometerSettings):
        description = eds.load(eds.locate(settings.eds, path), settings.node_id)
        return Inclinometer(name, settings, buses[settings.bus], description, path.parent)
    raise TypeError(f"no driver for {type(settings).__name__}")
