"""Device configuration files (CiA 306-1 §5): an EDS with a node's address and the values of its objects.

A DCF is written from the text of the device's own EDS, every byte of which stays but for what makes it a DCF.
"""

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import eds
from eds.datatypes import DATA_TYPES, DataType
from eds.description import Description, EdsError
from eds.ini import IniText, read_ini, section_key
from eds.numbers import parse_integer, parse_relative
from eds.values import in_type

Key = tuple[int, int]  # index, sub-index
Number = int | float

_OBJECT = re.compile(r"([0-9a-f]{4})(?:sub(?:0x)?([0-9a-f]{1,2}))?")
_COMPACT_VALUES = re.compile(r"([0-9a-f]{4})value")
_COMMISSIONING = ("devicecomissioning", "devicecommissioning")  # CiA 306 has one m
_COMMUNICATION = range(0x1000, 0x2000)


@dataclass(frozen=True, slots=True)
class Commissioning:
    """The device of a configuration; `baudrate` in bit/s."""

    node_id: int
    node_name: str
    network_name: str = ""
    baudrate: int | None = None


@dataclass(frozen=True, slots=True)
class Configuration:
    """Contents of a DCF: its device, and its objects' numbers; values of other kinds are left out."""

    description: Description
    values: Mapping[Key, Number]


# Writing


class _Section:
    """A section's lines, its header first; before the first header there is one without."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.lines: list[str] = []

    def set(self, entries: Mapping[str, str], end: str) -> None:
        """Give keys their values, behind the section's last line that says something."""
        self.drop(*entries)
        last = max((n for n, line in enumerate(self.lines, 1) if line.strip()), default=0)
        if last and not self.lines[last - 1].endswith(("\r", "\n")):
            self.lines[last - 1] += end
        self.lines[last:last] = [f"{key}={value}{end}" for key, value in entries.items()]

    def drop(self, *keys: str) -> None:
        lowered = {key.lower() for key in keys}
        self.lines = [line for line in self.lines if _key_of(line) not in lowered]


def configured(
    text: bytes,
    eds_name: str,
    file_name: str,
    commissioning: Commissioning,
    values: Mapping[Key, Number],
    now: datetime,
) -> bytes:
    """Return the DCF of a node whose EDS has this text: these values, and no others, are its configuration.

    Raises:
        EdsError: the EDS has no section for one of the values.

    """
    end = "\r\n" if b"\r\n" in text else "\n"
    sections = [
        section
        for section in _sections(text)
        if section.name not in _COMMISSIONING and not _COMPACT_VALUES.fullmatch(section.name)
    ]
    _set_values(sections, values, end, eds_name)
    about = _first(sections, "fileinfo", "[FileInfo]", end)
    about.set(
        {
            "FileName": file_name,
            "LastEDS": eds_name,
            "ModificationTime": f"{now:%I:%M%p}",
            "ModificationDate": f"{now:%m-%d-%Y}",
            "ModifiedBy": "GWRMS",
        },
        end,
    )
    sections.insert(sections.index(about) + 1, _commissioning(commissioning, end))
    return "".join(line for section in sections for line in section.lines).encode("latin-1")


def value_text(number: Number, key: Key) -> str:
    """As CiA 306 writes it: communication objects, which are identifiers and mappings, in hexadecimal."""
    if isinstance(number, int) and key[0] in _COMMUNICATION and number >= 0:
        return f"0x{number:X}"
    return repr(number)


def _sections(text: bytes) -> list[_Section]:
    sections = [_Section("")]
    for data in text.splitlines(keepends=True):
        line = data.decode("latin-1")  # byte for byte, whatever the encoding is
        bare = line.strip().removeprefix("\u00ef\u00bb\u00bf")  # a byte order mark
        if bare.startswith("["):
            sections.append(_Section(section_key(bare[1:].partition("]")[0])))
        sections[-1].lines.append(line)
    return sections


def _key_of(line: str) -> str | None:
    key, equals, _ = line.partition("=")
    bare = key.strip()
    return None if not equals or bare[:1] in (";", "#", "[") else bare.replace(" ", "").lower()


def _set_values(sections: list[_Section], values: Mapping[Key, Number], end: str, eds_name: str) -> None:
    left = dict(values)
    compact: dict[str, dict[int, str]] = {}
    for section in sections:
        section.drop("ParameterValue")
        if (match := _OBJECT.fullmatch(section.name)) is None:
            continue
        key = int(match[1], 16), int(match[2] or "0", 16)
        if any(_key_of(line) == "compactsubobj" for line in section.lines):
            entries = sorted(one for one in left if one[0] == key[0])
            texts = {sub: value_text(left.pop((index, sub)), key) for index, sub in entries}
            compact[match[1]] = compact.get(match[1], {}) | texts  # the section may stand twice
        elif key in left:
            section.set({"ParameterValue": value_text(left.pop(key), key)}, end)
    if left:
        missing = ", ".join(f"0x{index:04X}:{subindex}" for index, subindex in left)
        raise EdsError(f"{eds_name} has no section for {missing}; it is not the EDS of this device")
    for index, entries_of in compact.items():
        if entries_of:
            _add_compact(sections, index, entries_of, end)


def _add_compact(sections: list[_Section], index: str, entries: Mapping[int, str], end: str) -> None:
    """Set the values of an array whose entries have no sections of their own (CiA 306-1 §4.6.4)."""
    section = _Section(f"{index}value")
    section.lines = [f"{end}[{index.upper()}Value]{end}", f"NrOfEntries={len(entries)}{end}"]
    section.lines += [f"{subindex}={value}{end}" for subindex, value in entries.items()]
    at = max(n for n, one in enumerate(sections, 1) if one.name.startswith(index))
    sections.insert(at, section)


def _first(sections: list[_Section], name: str, header: str, end: str) -> _Section:
    """Return the section of that name, made where there is none."""
    found = next((one for one in sections if one.name == name), None)
    if found is None:
        found = _Section(name)
        found.lines = [f"{header}{end}", end]
        sections.insert(1, found)
    return found


def _commissioning(node: Commissioning, end: str) -> _Section:
    baudrate = {} if node.baudrate is None else {"Baudrate": str(node.baudrate // 1000)}
    section = _Section(_COMMISSIONING[0])
    section.lines = [f"[DeviceComissioning]{end}", end]
    section.set(
        {
            "NodeID": str(node.node_id),
            "NodeName": node.node_name,
            **baudrate,
            "NetNumber": "0",
            "NetworkName": node.network_name,
            "CANopenManager": "0",
        },
        end,
    )
    return section


# Reading


def owner(path: Path) -> tuple[int | None, str]:
    """Return the node's id and name that a DCF is for; some vendors' files name neither.

    Raises:
        EdsError: it cannot be read, or its NodeID is none.

    """
    ini = _read_ini(path)
    source = next((ini.sections[name] for name in _COMMISSIONING if name in ini.sections), {})
    if not source.get("nodeid"):
        return None, source.get("nodename", "")
    node_id = parse_integer(source["nodeid"])
    if node_id is None or not 1 <= node_id <= 127:
        raise EdsError(f"{path}: [DeviceComissioning] NodeID is {source['nodeid']!r}, not 1 to 127")
    return node_id, source.get("nodename", "")


def read(path: Path, node_id: int) -> Configuration:
    """Read a DCF, whoever wrote it, for the node `node_id`: what is relative to $NODEID is relative to that.

    Raises:
        EdsError: it is no DCF, or one of its values cannot be read; the message names section or line.

    """
    ini = _read_ini(path)
    for finding in ini.findings:
        if "parametervalue" in f"{finding.where}{finding.text}".lower():
            raise EdsError(f"{path}: {finding.where}: {finding.text}; correct it")
    description = eds.load(path, node_id)
    values: dict[Key, Number] = {}
    for where, key, text in _given(ini.sections):
        variable = description.variable(*key)
        known = DATA_TYPES.get((variable.data_type or 0) if variable is not None else 0)
        if known is not None and known.kind in ("boolean", "signed", "unsigned", "real"):
            number = _number(known, text, node_id)
            if number is None:
                raise EdsError(f"{path}: {where}={text} is no {known.name}; correct it")
            values[key] = number
    if not values:
        raise EdsError(f"{path}: no object has a ParameterValue; this is an EDS, or an empty DCF")
    return Configuration(description, values)


def _read_ini(path: Path) -> IniText:
    from eds.loader import read_text  # canopen is heavy, and not everybody reads a file

    return read_ini(read_text(path))


def _given(sections: Mapping[str, Mapping[str, str]]) -> Iterator[tuple[str, Key, str]]:
    """Yield every value that is not empty: where it stands, whose it is, its text."""
    for name, keys in sections.items():
        if match := _OBJECT.fullmatch(name):
            if text := keys.get("parametervalue"):
                yield f"[{name}] ParameterValue", (int(match[1], 16), int(match[2] or "0", 16)), text
        elif match := _COMPACT_VALUES.fullmatch(name):
            for key, text in keys.items():
                if key.isdecimal() and text:
                    yield f"[{name}] {key}", (int(match[1], 16), int(key)), text


def _number(known: DataType, text: str, node_id: int) -> Number | None:
    if known.kind == "real":
        return _real(text)
    text = {"true": "1", "false": "0"}.get(text.lower(), text)
    relative = parse_relative(text)
    number = parse_integer(text) if relative is None else relative + node_id
    return None if number is None else in_type(number, known)


def _real(text: str) -> float | None:
    try:
        number = float(text)
    except ValueError:
        return None
    return number if math.isfinite(number) else None
