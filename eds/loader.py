"""Loads an EDS or DCF: read, repair, import with canopen, check for another node's values.

The drives of a robot have one file, and all that does not depend on the node is done once for it.
"""

import configparser
import functools
import hashlib
import io
import pickle
from dataclasses import dataclass
from pathlib import Path

import canopen
from canopen.objectdictionary import ODVariable

from eds.datatypes import DATA_TYPES
from eds.description import Description, EdsError
from eds.ini import IniText, Sections, read_ini
from eds.numbers import parse_integer
from eds.repair import repair

MAX_BYTES = 8 * 1024 * 1024
# Files of a robot whose objects are kept: as bytes of this process, because whoever gets a dictionary may
# change it. No file is ever unpickled.
KEPT = 8

_UTF_16 = (b"\xff\xfe", b"\xfe\xff")
NODE_ID = "$NODEID"  # what a repaired value is relative to
# Base identifiers of the predefined connection set that carry a node id (CiA 301 §7.3.3).
_CONNECTION_SET = frozenset(range(0x080, 0x600, 0x080)) | {0x600, 0x700}
_OTHERS_DATA = frozenset((0x180, 0x280, 0x380, 0x480))  # of TPDOs
_COB_ID_VALID_BITS = 0x1FFF_FFFF


class _EdsText(io.StringIO):
    """The repaired text under a name that the importer recognises as an EDS."""

    name = "repaired.eds"


@dataclass(frozen=True, slots=True)
class _Owner:
    """The node that the file was made for, and the node that it is loaded for."""

    file_node_id: int | None
    node_id: int


def load_file(path: Path, node_id: int) -> Description:
    """See `eds.load`."""
    if not 1 <= node_id <= 127:
        raise EdsError(f"{path}: node id {node_id} is outside 1–127")
    text = read_text(path)
    ini, sections, file_node_id = pickle.loads(_repaired(text))
    if not any(len(name) == 4 for name in sections):
        raise EdsError(f"{path}: there is no object section like [1000]; this is no EDS or DCF file")
    owner = _Owner(file_node_id, node_id)
    if file_node_id not in (None, 0, node_id):
        ini.warn(
            "[DeviceComissioning] NodeID",
            f"the file is for node {file_node_id}; {node_id} is configured and counts",
        )
    _readdress(ini, sections, owner)
    dictionary = _import(path, sections, node_id)
    dictionary.node_id = node_id
    _set_limits(ini, sections, dictionary)
    information = dictionary.device_information
    return Description(
        path=path,
        object_dictionary=dictionary,
        vendor=information.vendor_name or "",
        product=information.product_name or "",
        vendor_id=_identity(dictionary, 1, information.vendor_number),
        product_code=_identity(dictionary, 2, information.product_number),
        findings=tuple(ini.findings),
        digest=hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest(),
    )


def read_text(path: Path) -> str:
    """Return the file's text, in UTF-8 or as Windows writes it; raises `EdsError` where it cannot be read."""
    try:
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except OSError as error:
        raise EdsError(f"{path}: cannot be read: {error.strerror}") from error
    if len(data) > MAX_BYTES:
        raise EdsError(f"{path}: is larger than {MAX_BYTES // 2**20} MiB; this is no EDS or DCF file")
    if data[:2] in _UTF_16:
        return data.decode("utf-16", errors="replace")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("cp1252", errors="replace")
    if text.lstrip().startswith("<?xml"):
        raise EdsError(
            f"{path}: is XML, so likely an XDD or XDC file (CiA 311), which cannot be read; "
            "take the EDS or DCF from the vendor, or export one with the vendor's tool"
        )
    return text


@functools.lru_cache(KEPT)
def _repaired(text: str) -> bytes:
    """Return the text's findings, its repaired sections and the node id that it was made for, pickled."""
    ini = read_ini(text)
    sections, file_node_id = repair(ini)
    return pickle.dumps((IniText(findings=ini.findings), sections, file_node_id))


def _import(path: Path, sections: Sections, node_id: int) -> canopen.ObjectDictionary:
    lines = []
    for name, keys in sections.items():
        lines.append(f"[{name}]")
        lines.extend(f"{key}={value}" for key, value in keys.items())
    try:
        dictionary: canopen.ObjectDictionary = pickle.loads(_imported("\n".join(lines)))
    except (configparser.Error, ValueError, KeyError) as error:
        raise EdsError(f"{path}: {error}; the file is broken in a way that is not known here") from error
    for entry in dictionary.values():
        members = getattr(entry, "subindices", None)
        for variable in (entry,) if members is None else members.values():
            _add_node_id(variable, node_id)
    return dictionary


@functools.lru_cache(KEPT)
def _imported(text: str) -> bytes:
    """Return the object dictionary of a repaired text for node 0, pickled."""
    return pickle.dumps(canopen.import_od(_EdsText(text), 0))


def _add_node_id(variable: ODVariable, node_id: int) -> None:
    """Add the node id to what is relative to it."""
    if isinstance(variable.default, int) and NODE_ID in getattr(variable, "default_raw", ""):
        variable.default += node_id
    if isinstance(variable.value, int) and NODE_ID in getattr(variable, "value_raw", ""):
        variable.value += node_id


def _readdress(ini: IniText, sections: Sections, owner: _Owner) -> None:
    """Make COB-IDs that a file gives for another node those of the configured one."""
    for name, keys in sections.items():
        for key in ("DefaultValue", "ParameterValue"):
            cob_id = parse_integer(keys.get(key, "")) if _is_cob_id(name) else None
            if cob_id is not None:
                listens = _is_rpdo(name) and cob_id & 0x780 in _OTHERS_DATA
                keys[key] = str(cob_id) if listens else _readdressed(ini, f"[{name}] {key}", cob_id, owner)


def _is_cob_id(section: str) -> bool:
    """EMCY (1014h), and the COB-IDs of SDO servers, RPDOs and TPDOs (1200h.., 1400h.., 1800h..)."""
    index, _, subindex = section.partition("sub")
    if section == "1014":
        return True
    if subindex not in ("1", "2"):
        return False
    number = int(index, 16)
    is_pdo = 0x1400 <= number < 0x1600 or 0x1800 <= number < 0x1A00
    return 0x1200 <= number < 0x1280 or (is_pdo and subindex == "1")


def _is_rpdo(section: str) -> bool:
    return 0x1400 <= int(section[:4], 16) < 0x1600


def _readdressed(ini: IniText, where: str, cob_id: int, owner: _Owner) -> str:
    base = cob_id & 0x780
    belongs_to = cob_id & 0x7F
    unchanged = str(cob_id)
    extended = cob_id & _COB_ID_VALID_BITS > 0x7FF
    if extended or base not in _CONNECTION_SET or belongs_to in (0, owner.node_id):
        return unchanged
    if belongs_to != owner.file_node_id:
        ini.warn(
            where,
            f"COB-ID 0x{cob_id & 0x7FF:03X} is fixed and belongs to node {belongs_to}, not {owner.node_id}",
        )
        return unchanged
    ini.warn(
        where, f"0x{cob_id & 0x7FF:03X} belongs to node {belongs_to}; read as 0x{base:03X} + {owner.node_id}"
    )
    return f"{NODE_ID}+0x{cob_id - belongs_to:X}"


def _set_limits(ini: IniText, sections: Sections, dictionary: canopen.ObjectDictionary) -> None:
    """Limits that the importer drops (reals, odd widths).

    Those that contradict each other stay, and are told: without them everything would be allowed.
    """
    for name, keys in sections.items():
        if "LowLimit" not in keys and "HighLimit" not in keys:
            continue
        low = high = None
        variable = _described(dictionary, name)
        if variable is not None:
            variable.min = low = _limit(variable, keys.get("LowLimit"))
            variable.max = high = _limit(variable, keys.get("HighLimit"))
        if low is not None and high is not None and low > high:
            ini.warn(f"[{name}]", f"LowLimit {low} is above HighLimit {high}; no value is allowed")


def _described(dictionary: canopen.ObjectDictionary, section: str) -> ODVariable | None:
    """Return the object of a section like [1018sub1] or [6064]."""
    index, _, subindex = section.partition("sub")
    return dictionary.get_variable(int(index, 16), int(subindex or "0", 16))


def _limit(variable: ODVariable, text: str | None) -> int | None:
    data_type = DATA_TYPES[variable.data_type or 0]
    if text is None or data_type.kind not in ("signed", "unsigned", "real"):
        return None
    if data_type.kind == "real":
        # The importer's annotation knows integers only; what it stores has no type.
        return float(text)  # type: ignore[return-value]
    return parse_integer(text)


def _identity(
    dictionary: canopen.ObjectDictionary, subindex: int, from_device_info: int | None
) -> int | None:
    """Vendor and product of 1018h; [DeviceInfo] where the object has no default."""
    variable = dictionary.get_variable(0x1018, subindex)
    default = None if variable is None else variable.default
    return default if isinstance(default, int) and default else from_device_info
