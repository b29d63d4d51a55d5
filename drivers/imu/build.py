"""The component that a table `[imu.NAME]` of the robot's file means."""

import msgspec

from drivers.build_context import BuildContext
from drivers.imu.settings import MountedSettings, wiring_of
from drivers.imu.trunk import TrunkImu


def build_imu(name: str, settings: MountedSettings, site: BuildContext) -> TrunkImu:
    """Return the IMU that `settings` describe.

    Raises:
        SettingsError: they contradict themselves or the device's file.
        EdsError: the device's file is not there or cannot be used.

    """
    chosen = wiring_of(settings.format).formats[settings.format]
    if not isinstance(settings, chosen.settings):  # the table says nothing that only this format has
        settings = msgspec.convert(msgspec.structs.asdict(settings), chosen.settings)
    return chosen.build(name, settings, site)
