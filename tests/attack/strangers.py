"""Attacks by programs that speak something else: they change nothing, and are answered nothing."""

import ssl

from tests.attack.attack import Strike
from tests.attack.barrage import Manner, Said, Target, barrage, request
from tests.attack.robot_file import PARAMETER

AGAIN_S = 0.2
CONNECTIONS = 4
BODY = request("control.acquire", ttl_s=60) + request("parameter.write", changes={PARAMETER: 7})
HTTP = (
    b"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\nOrigin: http://example.com\r\nContent-Type: text/plain\r\n"
    b"Content-Length: %d\r\n\r\n%s" % (len(BODY), BODY)
)
SSH = b"SSH-2.0-OpenSSH_9.6\r\n" + bytes([0, 0, 0, 60, 6, 20]) + bytes(range(16)) * 3


def tls_hello() -> bytes:
    """The first that a TLS client says."""
    context = ssl.create_default_context()
    sent = ssl.MemoryBIO()
    client = context.wrap_bio(ssl.MemoryBIO(), sent, server_hostname="robot.example")
    try:
        client.do_handshake()
    except ssl.SSLWantReadError:
        return sent.read()
    raise RuntimeError("a handshake with nobody is over")


class Stranger:
    """Says this, and waits for an answer that should not come."""

    def __init__(self, words: bytes) -> None:
        self._words = words

    def __call__(self, target: Target) -> Said:
        manner = Manner(self._words, piece=len(self._words), pause_s=AGAIN_S)
        return barrage(target, CONNECTIONS, manner)


ATTACKS = (
    Strike("http", "HTTP POST whose body writes a parameter", Stranger(HTTP), changes_nothing=True),
    Strike("tls", "TLS hello", Stranger(tls_hello()), changes_nothing=True),
    Strike("ssh", "SSH banner", Stranger(SSH), changes_nothing=True),
)
