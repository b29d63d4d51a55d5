"""The IMUs that are CANopen devices: a file each that defines FORMAT, found by its name."""

from typing import TYPE_CHECKING

from drivers.folder import Folder

if TYPE_CHECKING:
    from drivers.imu.format import NodeFormat

FORMATS: "Folder[NodeFormat]" = Folder(__name__)
