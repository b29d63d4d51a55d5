"""Which transport serves which interface name."""

from collections.abc import Callable

from drivers.bus.frames import Transport
from drivers.bus.settings import CanSettings
from drivers.errors import Unavailable


def _socketcand(settings: CanSettings) -> Transport:
    from drivers.bus.interfaces.socketcand import SocketcandTransport

    try:
        host, port = str(settings.more["host"]), int(settings.more["port"])
    except (KeyError, ValueError) as error:
        raise Unavailable("interface socketcand needs the keys host and port in its [can.…] table") from error
    return SocketcandTransport(host, port, str(settings.channel))


def _socketcan(settings: CanSettings) -> Transport:
    if settings.more:  # such as CAN FD: only python-can knows these keys
        return _python_can(settings)
    from drivers.bus.interfaces.socketcan import open_socketcan

    return open_socketcan(settings)


def _python_can(settings: CanSettings) -> Transport:
    from drivers.bus.interfaces.python_can import PythonCanTransport

    return PythonCanTransport(settings)


_OWN: dict[str, Callable[[CanSettings], Transport]] = {
    "socketcand": _socketcand,
    "socketcan": _socketcan,
}


def needs_python_can(settings: CanSettings) -> bool:
    """Whether the interface is opened by python-can, and not by a transport of ours."""
    return settings.interface not in _OWN or (settings.interface == "socketcan" and bool(settings.more))


def open_transport(settings: CanSettings) -> Transport:
    """Open the interface that `settings` name; imports only what it needs. Raises `Unavailable`."""
    return _OWN.get(settings.interface, _python_can)(settings)
