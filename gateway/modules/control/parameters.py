"""Parameters: which object of which device stands behind a name, its limits, and who may change it.

The limits of the robot's file and of the EDS both count, the stricter wins. What the EDS alone offers is
read-only until the robot's file releases it.
"""

from dataclasses import dataclass
from enum import Enum

from drivers.bus.values import size_of
from eds.datatypes import DATA_TYPES
from gateway.coding import NUMBERS, Coding, CodingError, Limit, Number, broken_limit, text, words
from gateway.config.robot import ParameterSettings
from gateway.wire.framing import ErrorKind, RpcError, refuse
from gateway.wire.parameter import ParameterInfo

READABLE = ("rw", "rwr", "rww", "ro", "const")
WRITABLE = ("rw", "rwr", "rww")


class Lock(Enum):
    """Reason why an EDS's parameter is read-only: in a word, and the remedy."""

    TEXT = "no number"
    UNRELEASED = "not released"
    COMMANDED = "commanded"
    STOPPING = "stopping"
    COMMUNICATION = "communication"
    STORAGE = "storage"
    CONTROLWORD = "controlword"

    @property
    def remedy(self) -> str:
        """The remedy, without the name of a parameter."""
        return _REMEDIES[self]


_REMEDIES = {
    Lock.TEXT: "it is no number, and can only be read",
    Lock.UNRELEASED: 'add "{name}" to release in {table} of the robot\'s file',
    Lock.COMMANDED: "who leads the bus writes it; to change it all the same, add its whole name "
    '"{name}" to release in {table} of the robot\'s file: a glob does not reach it',
    Lock.STOPPING: "it decides how the drive stops; to change it all the same, add its whole name "
    '"{name}" to release in {table} of the robot\'s file: a glob does not reach it',
    Lock.COMMUNICATION: "from 1000h to 1FFFh is how the bus works, which belongs to who leads it; release "
    "does not reach it, only a [parameter] table of its own",
    Lock.STORAGE: "storing and restoring are commands of their own: gwrms store, gwrms restore",
    Lock.CONTROLWORD: "it enables drives, and is never written as a parameter",
}
_BEYOND = {Limit.MIN: "below the minimum", Limit.MAX: "above the maximum"}


def contradiction(least: Number | None, most: Number | None, where: str) -> str | None:
    """Return why no value can be within limits that contradict each other; `None` if they do not."""
    if least is None or most is None or least <= most:
        return None
    return f"its limits allow nothing: minimum {text(least)} is above maximum {text(most)}; correct {where}"


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter, resolved against its device's EDS. `problem` says why it cannot be used.

    `table` is where the robot's file describes its device.
    """

    name: str
    component: str
    settings: ParameterSettings
    index: int
    subindex: int
    data_type: int = 0
    access: str = ""
    min: Number | None = None
    max: Number | None = None
    store: bool = False
    problem: str | None = None
    lock: Lock | None = None
    table: str = ""
    default: Number | None = None  # that the EDS gives

    @property
    def object(self) -> str:
        return f"0x{self.index:04X}:{self.subindex}"

    @property
    def coding(self) -> Coding:
        return Coding(self.data_type, self.settings.scale)

    @property
    def is_number(self) -> bool:
        """Whether it has a value, and no text; so has one that cannot be used."""
        known = DATA_TYPES.get(self.data_type)
        return known is None or known.kind in NUMBERS

    @property
    def is_long(self) -> bool:
        """Whether it may be of any length, so that it is read only where it is named."""
        return not self.is_number and DATA_TYPES[self.data_type].kind == "bytes"

    @property
    def read_only(self) -> str | None:
        """In a word, why it cannot be written; `None` where it can, or cannot be used at all."""
        if self.problem is not None:
            return None
        if self.access not in WRITABLE and self.lock is not Lock.TEXT:
            return f"{self.access} in the EDS"
        return None if self.lock is None else self.lock.value

    @property
    def max_step(self) -> float | None:
        return self.settings.max_step

    @property
    def info(self) -> ParameterInfo:
        """As `robot.describe` shows it."""
        settings = self.settings
        known = DATA_TYPES.get(self.data_type)
        return ParameterInfo(
            name=self.name,
            unit=settings.unit,
            min=self.min,
            max=self.max,
            max_step=self.max_step,
            live=settings.live,
            states=None if settings.states is None else list(settings.states),
            component=self.component,
            object=self.object,
            access=self.access,
            store=self.store,
            problem=self.problem,
            read_only=self.read_only,
            type="" if known is None else known.name,
            scale=settings.scale,
            default=self.default,
        )

    def refusal(self, kind: ErrorKind, text: str, limit: float | None = None) -> RpcError:
        """Return an error about this parameter."""
        return refuse(kind, f"{self.name}: {text}", component=self.component, object=self.object, limit=limit)

    def check_readable(self) -> None:
        """Raise `RpcError` where it cannot be read."""
        if self.problem is not None:
            raise self.refusal(ErrorKind.UNAVAILABLE, self.problem)
        if self.access not in READABLE:
            raise self.refusal(
                ErrorKind.NOT_ALLOWED, f"{self.object} cannot be read, the EDS says {self.access!r}"
            )

    def check_writable(self) -> None:
        """Raise `RpcError` where it cannot be written, or not be read back."""
        self.check_readable()
        if self.access not in WRITABLE:
            raise self.refusal(
                ErrorKind.READ_ONLY, f"{self.object} is read-only, the EDS says {self.access!r}"
            )
        if self.lock is not None:
            raise self.refusal(ErrorKind.READ_ONLY, f"{self.object} is read-only: {self.remedy(self.lock)}")

    def remedy(self, lock: Lock) -> str:
        """In full words, what to do about this lock of it."""
        return lock.remedy.format(name=self.name.partition(".")[2], table=self.table)

    def encode(self, value: Number) -> bytes:
        """Return the bytes to write, checked against access, type and limits.

        Raises:
            RpcError: read_only, not_allowed or out_of_limit.

        """
        self.check_writable()
        unit, is_real = self.settings.unit, self.coding.type.kind == "real"
        said = f"{text(value)} {unit}"
        if not is_real:  # of which only what the device makes of it can be compared
            self._check_limits(value, said)
        try:
            data = self.coding.encode(value)
        except CodingError as error:
            raise self.refusal(ErrorKind.OUT_OF_LIMIT, str(error)) from error
        held = self.decode(data)
        would_hold = f"{text(held)} {unit}, which is what the device would hold of {text(value)},"
        self._check_limits(held, said if is_real else would_hold)
        return data

    def accepts(self, data: bytes) -> Number:
        """Return the value of bytes that may be written as they are: what a device held before.

        Raises:
            RpcError: read_only, not_allowed, mismatch or out_of_limit.

        """
        self.check_writable()
        if len(data) != size_of(self.data_type):
            raise self.refusal(ErrorKind.MISMATCH, f"{data.hex(' ')} is no {self.coding.type.name}")
        value = self.decode(data)
        self._check_limits(value, f"{text(value)} {self.settings.unit}")
        return value

    def told(self, data: bytes) -> Number | str:
        """Return the meaning of the device's bytes: a value, or a text.

        Raises `RpcError` (mismatch) as `decode`.
        """
        return self.decode(data) if self.is_number else words(data, self.data_type)

    def decode(self, data: bytes) -> Number:
        """Return the value that the device's bytes mean.

        Raises `RpcError` (mismatch) where they mean none.
        """
        try:
            return self.coding.decode(data)
        except CodingError as error:
            raise self.refusal(ErrorKind.MISMATCH, f"the device holds what is no value: {error}") from error

    def _check_limits(self, value: Number, said: str) -> None:
        broken = broken_limit(self, self.coding, value)
        if broken is not None:
            limit: Number = getattr(self, broken)
            text_ = f"{said} is {_BEYOND[broken]} {text(limit)} {self.settings.unit}"
            raise self.refusal(ErrorKind.OUT_OF_LIMIT, text_, limit)
