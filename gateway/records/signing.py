"""The journal's head, signed by the robot's key: what a desk keeps of it shows whoever rewrites the journal.

Nothing is signed before somebody asks, and nothing twice: the program that signs takes some milliseconds.
"""

import base64
import time
from typing import Final

import msgspec

from gateway import signatures
from gateway.access.folder import AccessFolder
from gateway.certificates import KeyProblem, der_of, pem_of
from gateway.records.chain import Head
from gateway.wire.control import JournalProof, SignedHead

_KIND: Final = b"gwrms journal head 1\n"  # TLS and models sign with this key too: none is taken for another
KEYLESS: Final = "this robot has no key that could sign: gwrms keys pair makes one"
EMPTY: Final = "the journal is empty"


class HeadSigner:
    """Signs for one robot; for one thread."""

    def __init__(self, folder: AccessFolder, robot: str) -> None:
        self._folder = folder
        self._robot = robot
        self._newest: SignedHead | None = None

    def proof(self, head: Head) -> JournalProof:
        """Return the head signed, or why it is not."""
        if head.n == 0:
            return JournalProof(unsigned=EMPTY)
        if not self._folder.has_keys:
            return JournalProof(unsigned=KEYLESS)
        if self._newest is None or (self._newest.n, self._newest.hash) != (head.n, head.hash):
            try:
                self._newest = self._signed(head)
            except (KeyProblem, OSError) as error:
                return JournalProof(unsigned=str(error))
        return JournalProof(self._newest)

    def _signed(self, head: Head) -> SignedHead:
        certificate = pem_of(der_of(self._folder.certificate.read_bytes())).decode("ascii")
        unsigned = SignedHead(self._robot, head.n, head.hash, time.time_ns(), certificate, "")
        signature = signatures.sign(self._folder.key, message(unsigned))
        return msgspec.structs.replace(unsigned, signature=base64.b64encode(signature).decode("ascii"))


def message(head: SignedHead) -> bytes:
    """Return the bytes that are signed for a head."""
    return _KIND + msgspec.json.encode([head.robot, head.n, head.hash, head.utc_ns])
