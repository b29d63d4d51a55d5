"""Parameters: which object of which device stands behind a name, its limits, and its value as bytes.

The limits of the robot's file and of the EDS both count, the stricter wins. Scaling is decimal, so that a
value is exactly what the device holds: 0.42 m at 0.001 m a count is 420 counts and 0.42 m again.
"""

import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from decimal import ROUND_HALF_EVEN, Decimal

from drivers.bus.values import decode
from eds import Description
from eds.datatypes import DATA_TYPES, DataType
from gateway.config import ParameterSettings
from gateway.messages import ParameterInfo
from gateway.wire import Kind, RpcError, refuse

STORE = 0x1010
_READABLE = ("rw", "rwr", "rww", "ro", "const")
_WRITABLE = ("rw", "rwr", "rww")
_REAL_FORMATS = {32: "<f", 64: "<d"}


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter, resolved against its device's EDS. `problem` says why it cannot be used."""

    name: str
    component: str
    settings: ParameterSettings
    index: int
    subindex: int
    data_type: int = 0
    access: str = ""
    min: float | None = None
    max: float | None = None
    store: bool = False
    problem: str | None = None

    @property
    def object(self) -> str:
        return f"0x{self.index:04X}:{self.subindex}"

    @property
    def type(self) -> DataType:
        return DATA_TYPES[self.data_type]

    @property
    def info(self) -> ParameterInfo:
        """As `robot.describe` shows it."""
        settings = self.settings
        return ParameterInfo(
            name=self.name,
            unit=settings.unit,
            min=self.min,
            max=self.max,
            max_step=settings.max_step,
            live=settings.live,
            states=None if settings.states is None else list(settings.states),
            component=self.component,
            object=self.object,
            access=self.access,
            store=self.store,
            problem=self.problem,
        )

    def refusal(self, kind: Kind, text: str, limit: float | None = None) -> RpcError:
        """An error about this parameter."""
        return refuse(kind, f"{self.name}: {text}", component=self.component, object=self.object, limit=limit)

    def check_readable(self) -> None:
        """Raise `RpcError` where it cannot be read."""
        if self.problem is not None:
            raise self.refusal(Kind.UNAVAILABLE, self.problem)
        if self.access not in _READABLE:
            raise self.refusal(
                Kind.NOT_ALLOWED, f"{self.object} cannot be read, the EDS says {self.access!r}"
            )

    def encode(self, value: float) -> bytes:
        """The bytes to write, checked against access, type and limits.

        Raises:
            RpcError: read_only, not_allowed or out_of_limit.

        """
        self.check_readable()  # what cannot be read back cannot be verified
        if self.access not in _WRITABLE:
            raise self.refusal(Kind.READ_ONLY, f"{self.object} is read-only, the EDS says {self.access!r}")
        self._check_limits(value, "")
        data = self._pack(value)
        self._check_limits(self.decode(data), f", which is what the device would hold of {value:g}")
        return data

    def decode(self, data: bytes) -> float:
        """The value that the device's bytes mean; raises `RpcError` (mismatch) where they mean none."""
        number = decode(data, self.data_type)
        if number is None or not math.isfinite(number):
            raise self.refusal(
                Kind.MISMATCH, f"the device holds {data.hex(' ')}, which is no {self.type.name}"
            )
        if self.type.kind == "real":
            return number * self.settings.scale
        return float(Decimal(number) * Decimal(repr(self.settings.scale)))

    def _check_limits(self, value: float, why: str) -> None:
        unit = self.settings.unit
        for limit, beyond, word in ((self.min, -1, "below the minimum"), (self.max, 1, "above the maximum")):
            if limit is not None and (value - limit) * beyond > 0:
                text = f"{value:g} {unit}{why} is {word} {limit:g} {unit}"
                raise self.refusal(Kind.OUT_OF_LIMIT, text, limit)

    def _pack(self, value: float) -> bytes:
        if self.type.kind == "real":
            return self._pack_real(value / self.settings.scale)
        exact = Decimal(repr(value)) / Decimal(repr(self.settings.scale))
        number = int(exact.to_integral_value(ROUND_HALF_EVEN))
        size = ((self.type.bits or 8) + 7) // 8
        try:
            if self.type.kind == "boolean" and number not in (0, 1):
                raise OverflowError
            return number.to_bytes(size, "little", signed=self.type.kind == "signed")
        except OverflowError as error:
            text = f"{value:g} is {number} for the device, which does not fit {self.type.name}"
            raise self.refusal(Kind.OUT_OF_LIMIT, text) from error

    def _pack_real(self, number: float) -> bytes:
        try:
            return struct.pack(_REAL_FORMATS[self.type.bits or 0], number)
        except OverflowError as error:
            raise self.refusal(Kind.OUT_OF_LIMIT, f"{number:g} does not fit {self.type.name}") from error


def resolve(
    settings: Mapping[str, ParameterSettings],
    descriptions: Mapping[str, Description],
    absent: Mapping[str, str],
) -> dict[str, Parameter]:
    """Every parameter of the robot's file; what cannot be used says why."""
    return {name: _resolve(name, one, descriptions, absent) for name, one in settings.items()}


def _resolve(
    name: str, settings: ParameterSettings, descriptions: Mapping[str, Description], absent: Mapping[str, str]
) -> Parameter:
    component = name.partition(".")[0]
    index, subindex = settings.address
    low, high = settings.min, settings.max

    def unusable(problem: str) -> Parameter:
        return Parameter(name, component, settings, index, subindex, min=low, max=high, problem=problem)

    if component in absent:
        return unusable(absent[component])
    description = descriptions[component]
    variable = description.variable(index, subindex)
    if variable is None:
        return unusable(
            f'{description.path.name} has no object {settings.object}; correct [parameter."{name}"]'
        )
    known = DATA_TYPES.get(variable.data_type or 0)
    if known is None or known.kind not in ("boolean", "signed", "unsigned", "real"):
        return unusable(f"{settings.object} is no number in {description.path.name}; parameters are numbers")
    eds_low, eds_high = _scaled(variable.min, variable.max, settings.scale)
    return Parameter(
        name,
        component,
        settings,
        index,
        subindex,
        variable.data_type or 0,
        (variable.access_type or "").lower(),
        max((limit for limit in (low, eds_low) if limit is not None), default=None),
        min((limit for limit in (high, eds_high) if limit is not None), default=None),
        description.has(STORE, 1),
    )


def _scaled(low: float | None, high: float | None, scale: float) -> tuple[float | None, float | None]:
    """The EDS's limits in the parameter's unit; a negative scale turns them round."""
    scaled = [
        None if limit is None else float(Decimal(repr(limit)) * Decimal(repr(scale))) for limit in (low, high)
    ]
    return (scaled[1], scaled[0]) if scale < 0 else (scaled[0], scaled[1])
