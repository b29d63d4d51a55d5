"""Every parameter of a robot by its name: those that its file describes, and those that an EDS offers."""

from collections.abc import Iterable, Iterator, Mapping, Sequence

from eds import Description
from eds.datatypes import DATA_TYPES
from gateway.coding import NUMBERS, Number, scaled
from gateway.config.objects import STORE
from gateway.config.robot import ParameterSettings, RobotConfig
from gateway.modules.control.eds_parameters import offered
from gateway.modules.control.parameters import Parameter, contradiction
from gateway.streaming.sources import Wanted, check_globs

_TEXT = 'what is none is read where its device has parameters = "eds"'


class Catalogue(Mapping[str, Parameter]):
    """Parameters by name. An object's address, as in `left_knee.0x6072:0`, means the same parameter."""

    def __init__(self, parameters: Iterable[Parameter]) -> None:
        self._by_name = {one.name: one for one in parameters}
        self._by_address: dict[str, str] = {}
        for one in self._by_name.values():
            self._by_address.setdefault(f"{one.component}.{one.object}", one.name)

    def __getitem__(self, name: str) -> Parameter:
        return self._by_name[self._by_address.get(name, name)]

    def __iter__(self) -> Iterator[str]:
        return iter(self._by_name)

    def __len__(self) -> int:
        return len(self._by_name)

    def chosen(self, names: Sequence[str] | None) -> list[Parameter]:
        """Return those that the names, addresses and globs mean; without any, all that are not locked.

        Raises:
            RpcError: unknown_name, for one that means nothing.

        """
        if names is None:
            return [one for one in self._by_name.values() if one.lock is None]
        meant = {self._by_address.get(name, name) for name in names} & self._by_name.keys()
        globs = [name for name in names if name not in self]
        check_globs("parameter", self._by_name, globs)
        wanted = Wanted(globs)
        meant.update(name for name, one in self._by_name.items() if name in wanted and not one.is_long)
        return [one for name, one in self._by_name.items() if name in meant]


def resolve(
    config: RobotConfig, descriptions: Mapping[str, Description], absent: Mapping[str, str]
) -> Catalogue:
    """Return every parameter of the robot; what cannot be used says why."""
    own = [described(name, one, descriptions, absent) for name, one in config.parameter.items()]
    return Catalogue([*own, *offered(config, descriptions, own)])


def described(
    name: str, settings: ParameterSettings, descriptions: Mapping[str, Description], absent: Mapping[str, str]
) -> Parameter:
    """Return a parameter that the robot's file describes: `[parameter."name"]`."""
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
    if known is None or known.kind not in NUMBERS:
        return unusable(f"{settings.object} is no number in {description.path.name}: {_TEXT}")
    eds_low, eds_high = _scaled_limits(variable.min, variable.max, settings.scale)
    least = max((limit for limit in (low, eds_low) if limit is not None), default=None)
    most = min((limit for limit in (high, eds_high) if limit is not None), default=None)
    return Parameter(
        name,
        component,
        settings,
        index,
        subindex,
        variable.data_type or 0,
        variable.access_type.lower(),
        least,
        most,
        description.has(STORE, 1),
        contradiction(least, most, f'{description.path.name} or [parameter."{name}"]'),
        default=None if variable.default is None else scaled(variable.default, settings.scale),
    )


def _scaled_limits(
    low: Number | None, high: Number | None, scale: float
) -> tuple[Number | None, Number | None]:
    """Return the EDS's limits in the parameter's unit; a negative scale turns them round."""
    both = [None if limit is None else scaled(limit, scale) for limit in (low, high)]
    return (both[1], both[0]) if scale < 0 else (both[0], both[1])
