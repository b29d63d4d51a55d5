"""Errors of drivers.

    DriverError
    ├── SettingsError      the configuration contradicts itself or the device
    ├── Unavailable        the interface, port, file or node is not there (and may come back)
    ├── DeviceTimeout      the device did not answer in time (also a TimeoutError)
    ├── DeviceAbort        the device refused, with a CiA 301 abort code
    ├── LssRefusal         the device refused, with an error code of CiA 305
    ├── NotPermitted       a write is forbidden now, or nobody knows who would take it; nothing was sent
    └── Mismatch           the device holds another value than the one that was written

Every message names the device, the object and the value, and says what to do.
"""


class DriverError(Exception):
    """Root of everything the drivers raise."""


class SettingsError(DriverError, ValueError):
    """A setting cannot work: it contradicts another one, the EDS, or the device."""


class Unavailable(DriverError):
    """An interface, port or node is not there; the driver keeps trying."""


class DeviceTimeout(DriverError, TimeoutError):
    """The device did not answer within the time given."""


class DeviceAbort(DriverError):
    """The device answered an SDO request with an abort (CiA 301 §7.2.4.3.17)."""

    def __init__(self, message: str, abort_code: int) -> None:
        super().__init__(message)
        self.abort_code = abort_code


class LssRefusal(DriverError):
    """The device answered a layer setting service with an error code (CiA 305)."""

    def __init__(self, message: str, error_code: int, specific: int) -> None:
        super().__init__(message)
        self.error_code = error_code
        self.specific = specific  # the maker's own, where the code is 255


class NotPermitted(DriverError):
    """The write is not allowed now, and was not sent."""


class Mismatch(DriverError):
    """Reading back gave another value than the one written."""
