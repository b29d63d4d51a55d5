"""`./dev release`: the files of a release, built twice alike, with checksums and a bill of materials.

What is built is the newest commit, not what lies about.
"""

import hashlib
import importlib.util
import json
import os
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from gateway import __version__
from tools.sbom import bill

ROOT: Final = Path(__file__).parents[1]
LOCK: Final = ROOT / "requirements.lock"
SUMS: Final = "SHA256SUMS"
_MASKS: Final = (0o022, 0o077)  # of each build another one, and another folder: neither may show in the files


class NotReproducible(Exception):
    """The same commit gave two different files."""


def main(argv: list[str]) -> int:
    """Exit code: 0 all is there; 1 what was built twice differs, or a package has a known vulnerability."""
    into = Path(argv[0]) if argv else ROOT / "dist"
    into.mkdir(parents=True, exist_ok=True)
    epoch_s = int(_git("log", "-1", "--format=%ct"))
    try:
        made = reproduced(epoch_s)
    except NotReproducible as error:
        _say(f"NOT REPRODUCIBLE: {error}")
        return 1
    made[f"gwrms-{__version__}.cdx.json"] = sbom(epoch_s)
    made[SUMS] = sums(made)
    for name, content in made.items():
        (into / name).write_bytes(content)
        _say(f"{into / name}")
    if _git("status", "--porcelain"):
        _say("what is not committed is not in it")
    return audit()


def reproduced(epoch_s: int) -> dict[str, bytes]:
    """Wheel and sdist by their names, built twice; raises `NotReproducible`."""
    first, second = (_built(epoch_s, mask) for mask in _MASKS)
    if first.keys() != second.keys():
        raise NotReproducible(f"{', '.join(first)}; and then {', '.join(second)}")
    for name, content in first.items():
        if second[name] != content:
            raise NotReproducible(name)
    return first


def sbom(epoch_s: int) -> bytes:
    """Return the bill of materials as its file has it."""
    document = bill(__version__, epoch_s, LOCK.read_text(encoding="utf-8"))
    return json.dumps(document, indent=1).encode("utf-8") + b"\n"


def sums(files: Mapping[str, bytes]) -> bytes:
    """Return it as `sha256sum --check` takes it."""
    lines = (f"{hashlib.sha256(content).hexdigest()}  {name}\n" for name, content in files.items())
    return "".join(lines).encode("ascii")


def audit() -> int:
    """Look for known vulnerabilities of what the lock file names, where there is something to look with."""
    if importlib.util.find_spec("pip_audit") is None:
        _say(
            "pip-audit is not installed: NOBODY HAS LOOKED for known vulnerabilities (pip install pip-audit)"
        )
        return 0
    command = [
        sys.executable,
        "-m",
        "pip_audit",
        "--requirement",
        str(LOCK),
        "--require-hashes",
        "--disable-pip",
    ]
    return min(1, subprocess.run(command, check=False).returncode)


def _built(epoch_s: int, mask: int) -> dict[str, bytes]:
    environment = os.environ | {"SOURCE_DATE_EPOCH": str(epoch_s)}
    with tempfile.TemporaryDirectory() as folder:
        source, into = Path(folder) / f"source-{mask:o}", Path(folder) / "dist"
        _check_out(source)
        command = [sys.executable, "-m", "hatchling", "build", "-d", str(into)]
        subprocess.run(command, cwd=source, env=environment, umask=mask, check=True, capture_output=True)
        return {file.name: file.read_bytes() for file in sorted(into.iterdir())}


def _check_out(source: Path) -> None:
    with tempfile.TemporaryFile() as archive:
        subprocess.run(["git", "archive", "HEAD"], cwd=ROOT, stdout=archive, check=True)
        archive.seek(0)
        with tarfile.open(fileobj=archive) as opened:
            opened.extractall(source, filter="data")


def _git(*words: str) -> str:
    return subprocess.run(
        ["git", *words], cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout.strip()


def _say(text: str) -> None:
    sys.stdout.write(f"{text}\n")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
