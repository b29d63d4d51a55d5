"""Every method of the wire by its name; the names are a contract."""

from collections.abc import Mapping
from typing import Final

from gateway.wire import bus, component, control, cost, dictionary, parameter, resource, robot, stop, stream
from gateway.wire.method import AnyMethod

METHODS: Final[Mapping[str, AnyMethod]] = {
    method.name: method
    for group in (robot, cost, resource, component, bus, stream, control, parameter, dictionary, stop)
    for method in group.METHODS
}
