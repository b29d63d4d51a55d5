"""Where a robot listens: HOST:PORT as people type it."""

from dataclasses import dataclass

from gateway.client.errors import BadAddress

DEFAULT_HOST = "127.0.0.1"
DEFAULT_PORT = 7420


@dataclass(frozen=True, slots=True)
class Address:
    """A robot's TCP address."""

    host: str = DEFAULT_HOST
    port: int = DEFAULT_PORT

    @classmethod
    def parse(cls, text: str) -> "Address":
        """Read `HOST`, `HOST:PORT`, `:PORT` or `[IPV6]:PORT`.

        Raises:
            BadAddress: the text is none of these; an empty one may be a variable that was not set.

        """
        if "/" in text or any(map(str.isspace, text)):
            raise BadAddress(f"{text!r} is not a robot's address; write HOST:PORT, without more")
        if not text:
            raise BadAddress(f"an address is missing; write HOST:PORT, such as {DEFAULT_HOST}:{DEFAULT_PORT}")
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
        return f"[{self.host}]:{self.port}" if ":" in self.host else f"{self.host}:{self.port}"
