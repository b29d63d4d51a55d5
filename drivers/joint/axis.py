"""One axis of a drive, asked by SDO within a job of its node's worker."""

from drivers.bus.sdo.channel import SdoChannel
from drivers.bus.values import unsigned
from drivers.joint.cia402 import DriveState, drive_state
from drivers.joint.commands import CONTROLWORD, STATUSWORD, Controlword

ERROR_CODE = 0x603F
POSITION_ACTUAL = 0x6064


class Axis:
    """Objects at `offset` above those of the first axis. Every call raises `DriverError`, and asks once."""

    def __init__(self, sdo: SdoChannel, offset: int) -> None:
        self.sdo = sdo
        self.offset = offset

    def command(self, controlword: Controlword, timeout_s: float | None = None) -> None:
        """Send a controlword; that the drive took it does not say that it follows."""
        self.sdo.download(CONTROLWORD + self.offset, 0, controlword.data, timeout_s)

    def state(self, timeout_s: float | None = None) -> DriveState | None:
        """Return the state by its statusword; `None` for a pattern unknown to the standard."""
        return drive_state(unsigned(self.read(STATUSWORD, 2, timeout_s=timeout_s)))

    def error_code(self) -> int:
        """Return the code of the latest error (603Fh); 0 if there is none."""
        return unsigned(self.read(ERROR_CODE, 2))

    def position(self) -> int:
        """Return counts of 6064h."""
        return int.from_bytes(self.read(POSITION_ACTUAL, 4), "little", signed=True)

    def read(self, index: int, size: int, subindex: int = 0, timeout_s: float | None = None) -> bytes:
        """Return an object's first `size` bytes: some devices answer with four, whatever the object has."""
        return self.sdo.upload(index + self.offset, subindex, attempts=1, timeout_s=timeout_s)[:size]

    def write(self, index: int, data: bytes, subindex: int = 0) -> None:
        """Write one of the axis's other objects."""
        self.sdo.download(index + self.offset, subindex, data)
