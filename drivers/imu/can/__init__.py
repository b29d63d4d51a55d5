"""The IMUs on a CAN bus that send frames of their own: a file each that defines FORMAT, found by its name."""

from typing import TYPE_CHECKING

from drivers.folder import Folder

if TYPE_CHECKING:
    from drivers.imu.format import CanFormat

FORMATS: "Folder[CanFormat]" = Folder(__name__)
