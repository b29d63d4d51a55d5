"""The IMUs on serial ports: a file each that defines FORMAT, found by its name."""

from typing import TYPE_CHECKING

from drivers.folder import Folder

if TYPE_CHECKING:
    from drivers.imu.format import Format

FORMATS: "Folder[Format]" = Folder(__name__)
