"""Signatures (ECDSA over SHA-256) by the keys that robots and desks have for TLS."""

from pathlib import Path
from typing import Final

from gateway.certificates import KeyProblem, pem_of
from gateway.openssl import piped, run

MOST_BYTES: Final = 512  # of a signature; one with P-256 has 72


def sign(key: Path, message: bytes) -> bytes:
    """Return the signature of a message; each kind of message begins with words of its own.

    Raises:
        KeyProblem: the key cannot be used, or there is no program to do it.

    """
    try:
        with key.open("rb"):
            pass  # openssl's words about this would be less plain
    except OSError as error:
        raise KeyProblem(f"the key {key} cannot be read: {error.strerror or error}") from error
    return run(["dgst", "-sha256", "-passin", "pass:", "-sign", str(key)], message)


def holds(der: bytes, message: bytes, signature: bytes) -> bool:
    """Return whether the key of this certificate has signed the message.

    Raises:
        KeyProblem: nobody can say: the certificate is none, or there is no program to do it.

    """
    if not 0 < len(signature) <= MOST_BYTES:
        return False
    public = run(["x509", "-pubkey", "-noout"], pem_of(der))
    with piped(public) as key, piped(signature) as proof:
        command = ["dgst", "-sha256", "-verify", f"/dev/fd/{key}", "-signature", f"/dev/fd/{proof}"]
        try:
            run(command, message, key, proof)
        except KeyProblem:  # what is no signature at all has another text in each version
            return False
    return True
