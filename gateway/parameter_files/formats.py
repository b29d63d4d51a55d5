"""The format of a parameter file, by its name."""

from pathlib import Path
from typing import Final

from eds import EdsError
from gateway.parameter_files import dcf, toml_lines
from gateway.parameter_files.contents import FileProblem, Format, Saved, Scope

FORMATS: Final = {
    ".toml": Format(toml_lines.chosen, toml_lines.write, toml_lines.read),
    ".dcf": Format(dcf.chosen, dcf.write, dcf.read),
}


def format_of(file: Path) -> Format:
    """Return the format of a file of this name; raises `FileProblem` where there is none."""
    found = FORMATS.get(file.suffix.lower())
    if found is None:
        raise FileProblem(f"{file}: give a name that ends in {' or '.join(FORMATS)}")
    return found


def read_file(file: Path, scope: Scope) -> Saved:
    """Read a file's values; raises `FileProblem` if it cannot be read, or is another device's."""
    try:
        return format_of(file).read(file, scope)
    except EdsError as error:
        raise FileProblem(str(error)) from error
