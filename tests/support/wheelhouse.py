"""A folder of wheels for pip, in the place of a package index: packages of this environment, packed again."""

import importlib.metadata
import zipfile
from collections.abc import Iterable
from pathlib import Path
from typing import Final

SCRIPTS: Final = ".."  # made anew from the entry points, or by no test


def pack(packages: Iterable[str], into: Path) -> None:
    """A wheel of each that is installed."""
    for name in packages:
        _pack(importlib.metadata.distribution(name), into)


def _pack(package: importlib.metadata.Distribution, into: Path) -> None:
    said = package.read_text("WHEEL") or ""
    tags = [line.partition(": ")[2].split("-") for line in said.splitlines() if line.startswith("Tag: ")]
    tag = "-".join(".".join(dict.fromkeys(part)) for part in zip(*tags, strict=True))
    name = f"{package.name.replace('-', '_')}-{package.version}"
    files = [file for file in package.files or () if file.parts[0] != SCRIPTS and file.suffix != ".pyc"]
    (record,) = (file for file in files if file.match("*.dist-info/RECORD"))
    with zipfile.ZipFile(into / f"{name}-{tag}.whl", "w") as wheel:
        for file in files:
            if file != record:
                wheel.write(str(package.locate_file(file)), str(file))
        wheel.writestr(str(record), "".join(f"{file},,\n" for file in files))
