"""Errors of a client.

    ClientError
    ├── BadAddress         the text is not HOST:PORT (also a ValueError)
    ├── NotConnected       there is no link, so nothing was sent (also a ConnectionError)
    │   └── Unreachable    the link could not be made
    │       ├── NotPaired  the robot does not know this desk's key, or the desk has none
    │       └── WrongRobot the robot's certificate is not the one that was paired
    ├── LinkLost           the link dropped before the answer: the outcome is unknown (also a ConnectionError)
    ├── CallTimeout        no answer in time: the outcome is unknown (also a TimeoutError)
    ├── ProtocolError      what answers does not speak this protocol
    └── RemoteError        the robot refused: `code`, `kind` and `data` say why

Only `NotConnected` and `RemoteError` say that nothing was done. After the others a write or a stop may or
may not have happened: ask the robot before asking again.
"""

from collections.abc import Mapping
from typing import Final

NOTHING_SENT: Final = "nothing was sent"  # begins the `NotConnected` of a call


class ClientError(Exception):
    """Root of everything the client raises."""


class BadAddress(ClientError, ValueError):
    """An address that cannot be read as HOST:PORT."""


class NotConnected(ClientError, ConnectionError):
    """There is no link now; the request was not sent."""


class Unreachable(NotConnected):
    """The link could not be made."""


class NotPaired(Unreachable):
    """The robot lets in only whom it has paired with."""


class WrongRobot(Unreachable):
    """Another certificate than the pinned one: another robot, or somebody in between."""


class LinkLost(ClientError, ConnectionError):
    """The link dropped before the answer came; whether the request was carried out is unknown."""


class CallTimeout(ClientError, TimeoutError):
    """The answer did not come in time; whether the request was carried out is unknown."""


class ProtocolError(ClientError):
    """The other side speaks another protocol, or another version of it."""


class RemoteError(ClientError):
    """The robot's own refusal (a JSON-RPC error).

    `code` is JSON-RPC's number, `kind` the machine-readable word of the wire contract (None where the robot
    gave none), `data` everything else that it said: `component`, `object`, `abort_code`, `limit`, …
    """

    def __init__(self, code: int, message: str, data: Mapping[str, object] | None = None) -> None:
        super().__init__(message)
        self.code = code
        self.data: Mapping[str, object] = data or {}
        kind = self.data.get("kind")
        self.kind = kind if isinstance(kind, str) else None
