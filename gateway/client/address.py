"""Address of a gateway: HOST:PORT as typed, or the path of its Unix socket."""

from dataclasses import dataclass, field

from gateway.client.errors import BadAddress
from gateway.wire.pairing import has_code

DEFAULT_HOST = "127.0.0.1"
DEFAULT_PORT = 7420


@dataclass(frozen=True, slots=True)
class Address:
    """A robot's TCP address, or the path of its Unix socket as `host`.

    `pin` is the SHA-256 of the certificate that it must have; None: the one in the server's file, if any.
    `called` is the robot's name in that file, by which it was asked for.
    """

    host: str = DEFAULT_HOST
    port: int = DEFAULT_PORT
    pin: str | None = field(default=None, compare=False)
    called: str = field(default="", compare=False)

    @property
    def path(self) -> str | None:
        """The path of its Unix socket."""
        return self.host if "/" in self.host else None

    @classmethod
    def parse(cls, text: str) -> "Address":
        """Read `HOST`, `HOST:PORT`, `:PORT` or `[IPV6]:PORT`; what has a slash is a path.

        Raises:
            BadAddress: the text is none of these; an empty one may be a variable that was not set.

        """
        if has_code(text):
            raise BadAddress(
                "this has a pairing code in it, and no code is an address: write HOST:PORT here, and the "
                "code where it is asked for (gwrms pair). A host that is called so: write its domain too"
            )
        if "://" in text or any(map(str.isspace, text)):
            raise BadAddress(f"{text!r} is not a robot's address; write HOST:PORT, without more")
        if not text:
            raise BadAddress(f"an address is missing; write HOST:PORT, such as {DEFAULT_HOST}:{DEFAULT_PORT}")
        if "/" in text:
            return cls(text, 0)
        if text.isdigit() or text.endswith(".sock"):
            meant = f":{text}, a port of this computer" if text.isdigit() else f"./{text}, a path"
            raise BadAddress(f"{text!r} is not a robot's address; write {meant}, if that is meant")
        host, colon, port = text.rpartition(":") if not text.endswith("]") else (text, "", "")
        if not colon:
            host, port = (text, "")
        if host.startswith("[") and host.endswith("]"):
            host = host[1:-1]
        elif ":" in host:
            raise BadAddress(
                f"{text!r} is not a robot's address; write an IPv6 host as [{text}]:{DEFAULT_PORT}"
            )
        if port and not (port.isascii() and port.isdigit() and 0 < int(port) < 65536):
            raise BadAddress(
                f"{text!r} is not a robot's address; write HOST:PORT with a port from 1 to 65535"
            )
        return cls(host or DEFAULT_HOST, int(port) if port else DEFAULT_PORT)

    def __str__(self) -> str:
        if self.path is not None:
            return self.path
        return f"[{self.host}]:{self.port}" if ":" in self.host else f"{self.host}:{self.port}"
