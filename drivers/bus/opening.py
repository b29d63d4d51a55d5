"""Which transport serves which interface name."""

from collections.abc import Callable

from drivers.bus.frames import Transport
from drivers.bus.settings import CanSettings
from drivers.errors import Unavailable


def _socketcand(settings: CanSettings) -> Transport:
    from drivers.bus.socketcand import SocketcandTransport

    try:
        host, port = str(settings.more["host"]), int(settings.more["port"])
    except (KeyError, ValueError) as error:
        raise Unavailable("interface socketcand needs the keys host and port in its [can.…] table") from error
    return SocketcandTransport(host, port, str(settings.channel))


def _python_can(settings: CanSettings) -> Transport:
    from drivers.bus.python_can import PythonCanTransport

    return PythonCanTransport(settings)


_OWN: dict[str, Callable[[CanSettings], Transport]] = {"socketcand": _socketcand}


def open_transport(settings: CanSettings) -> Transport:
    """Open the interface that `settings` name; imports only what it needs. Raises `Unavailable`."""
    return _OWN.get(settings.interface, _python_can)(settings)
