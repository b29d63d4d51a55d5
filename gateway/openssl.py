"""The program `openssl`, which does on a robot what would else take a large library."""

import contextlib
import os
import shutil
import subprocess
from collections.abc import Iterator, Sequence

from gateway.certificates import KeyProblem


def run(arguments: Sequence[str], given: bytes, *descriptors: int) -> bytes:
    """Run openssl; return its standard output.

    Raises:
        KeyProblem: it is not here, or did not do it; with its own last words.

    """
    program = shutil.which("openssl")
    if program is None:
        raise KeyProblem(
            "keys are made and used by the program openssl, which is not here: apt install openssl"
        )
    command = [program, *arguments]
    found = subprocess.run(command, input=given, capture_output=True, check=False, pass_fds=descriptors)
    if found.returncode or not found.stdout:
        said = (found.stdout + found.stderr).decode("utf-8", "replace").strip().splitlines()
        raise KeyProblem(f"openssl {arguments[0]} failed: {said[-1] if said else found.returncode}")
    return found.stdout


@contextlib.contextmanager
def piped(content: bytes) -> Iterator[int]:
    """Return a descriptor to read this from, so that no file is ever readable for others.

    For what a pipe holds.
    """
    reader, writer = os.pipe()
    try:
        os.write(writer, content)
        os.close(writer)
        yield reader
    finally:
        os.close(reader)
