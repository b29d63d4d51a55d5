"""A tolerant reader of the INI text that EDS files are: it reports instead of giving up.

Windows' own INI functions, which wrote most of these files, take the first of two equal keys or sections,
so this reader does too.
"""

import re
from dataclasses import dataclass, field

from eds.description import Finding

Sections = dict[str, dict[str, str]]

_KEY = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_ .\-]*")
_INLINE_COMMENT = re.compile(r"\s;.*$")


@dataclass(slots=True)
class IniText:
    """Sections by their name in lower case; keys in lower case, values as written."""

    sections: Sections = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)

    def warn(self, where: str, text: str) -> None:
        self.findings.append(Finding("warning", where, text))

    def note(self, where: str, text: str) -> None:
        self.findings.append(Finding("info", where, text))


def section_key(header: str) -> str:
    """Return a section's name as it is compared: lower case, without blanks or a leading 0x."""
    name = re.sub(r"\s+", "", header).lower()
    return name.removeprefix("0x")


def read_ini(text: str) -> IniText:
    """Read every section and key that can be read; the rest becomes findings."""
    ini = IniText()
    section: str | None = None
    for number, raw in enumerate(text.splitlines(), start=1):
        line = raw.strip().removeprefix("\ufeff")
        if not line or line[0] in ";#":
            continue
        if line[0] == "[":
            section = _open_section(ini, line, number)
        elif section is None:
            ini.warn(f"line {number}", f"{line[:40]!r} stands before the first section; left out")
        else:
            _add_key(ini, section, line, number)
    return ini


def _open_section(ini: IniText, line: str, number: int) -> str:
    header, bracket, _ = line[1:].partition("]")
    if not bracket:
        ini.warn(f"line {number}", f"the section [{header[:40]} is not closed; read as if it were")
        header = header.partition(";")[0]
    name = section_key(header)
    if name in ini.sections:
        ini.note(
            f"[{header.strip()}]", f"the section stands twice (line {number}); the first one's values count"
        )
    ini.sections.setdefault(name, {})
    return name


def _add_key(ini: IniText, section: str, line: str, number: int) -> None:
    key, equals, value = line.partition("=")
    key = key.strip()
    name = key.replace(" ", "").lower()
    if not equals or not _KEY.fullmatch(key):
        ini.warn(f"line {number}", f"{line[:40]!r} is no key=value line; left out")
        return
    value = _INLINE_COMMENT.sub("", value.replace("\x00", "")).strip()
    known = ini.sections[section].setdefault(name, value)
    if known != value:
        ini.warn(
            f"[{section}] {key}",
            f"stands twice with different values; {known!r} counts, not {value!r} (line {number})",
        )
