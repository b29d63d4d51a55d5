"""Repairs what vendors' EDS files get wrong, so that the strict importer of canopen takes them.

The result holds only sections and keys that the importer reads, each in its canonical spelling and with a
value it can parse. Every repair that could change a meaning is a finding.
"""

import re

from eds import compact
from eds.datatypes import DATA_TYPE_BY_NAME, DATA_TYPES, DOMAIN, OBJECT_TYPE_BY_NAME, ObjectType
from eds.ini import IniText, Sections
from eds.numbers import parse_integer
from eds.values import canonical

_OBJECT = re.compile(r"[0-9a-f]{4}")
_SUBOBJECT = re.compile(r"([0-9a-f]{4})sub(?:0x)?([0-9a-f]{1,2})")
_LIKE_AN_OBJECT = re.compile(r"[0-9a-f]{4}")
_READ = re.compile(rf"{_OBJECT.pattern}(?:objectlinks)?|{_SUBOBJECT.pattern}")
_MODULES = re.compile(r"m\d+(?:fixed|subext)[0-9a-f]")

_DEVICE_TEXT = ("VendorName", "ProductName", "OrderCode")
_DEVICE_NUMBERS = (
    "VendorNumber", "ProductNumber", "RevisionNumber", "SimpleBootUpMaster", "SimpleBootUpSlave",
    "Granularity", "DynamicChannelsSupported", "GroupMessaging", "NrOfRXPDO", "NrOfTXPDO", "LSS_Supported",
    *(f"BaudRate_{rate}" for rate in (10, 20, 50, 125, 250, 500, 800, 1000)),
)  # fmt: skip
_ACCESS_TYPES = ("ro", "wo", "rw", "rwr", "rww", "const")
_LISTS = ("mandatoryobjects", "optionalobjects", "manufacturerobjects")
_COMMISSIONING = ("devicecomissioning", "devicecommissioning")


def repair(ini: IniText) -> tuple[Sections, int | None]:
    """Sections in canonical spelling, and the node id that the file was made for (`None` for an EDS)."""
    compact.write_out(ini)
    compact.give_values(ini)
    repaired: Sections = {"DeviceInfo": _device_info(ini), "DummyUsage": _dummy_usage(ini)}
    file_node_id, commissioning = _commissioning(ini)
    if commissioning:
        repaired["DeviceComissioning"] = commissioning
    tree = _object_tree(ini)
    for index, subindices in sorted(tree.items()):
        repaired |= _object(ini, index, sorted(subindices))
    _check_lists(ini, tree)
    _check_sections(ini)
    return repaired, file_node_id


def _device_info(ini: IniText) -> dict[str, str]:
    source = ini.sections.get("deviceinfo", {})
    if not source:
        ini.warn("[DeviceInfo]", "is missing; vendor and product are unknown")
    info = {key: source[key.lower()] for key in _DEVICE_TEXT if key.lower() in source}
    for key in _DEVICE_NUMBERS:
        number = _number(ini, "[DeviceInfo]", key, source.get(key.lower()))
        if number is not None:
            info[key] = str(number)
    if parse_integer(source.get("compactpdo", "0")):
        ini.note("[DeviceInfo]", "CompactPDO: PDO parameters are implied, not described")
    return info


def _number(ini: IniText, where: str, key: str, text: str | None) -> int | None:
    if text is None:
        return None
    number = parse_integer(text)
    if number is None:
        ini.note(
            f"{where} {key}", "is empty; left out" if not text else f"{text!r} is no clear number; left out"
        )
    return number


def _dummy_usage(ini: IniText) -> dict[str, str]:
    source = ini.sections.get("dummyusage", {})
    usage = {f"Dummy{code:04d}": parse_integer(source.get(f"dummy{code:04d}", "")) for code in range(1, 8)}
    missing = [key for key, value in usage.items() if value is None]
    if missing:
        ini.note("[DummyUsage]", f"{', '.join(missing)} missing; taken as 0")
    return {key: str(int(bool(value))) for key, value in usage.items()}


def _commissioning(ini: IniText) -> tuple[int | None, dict[str, str]]:
    source = next((ini.sections[name] for name in _COMMISSIONING if name in ini.sections), {})
    where = "[DeviceComissioning]"
    node_id = _number(ini, where, "NodeID", source.get("nodeid"))
    baudrate = _number(ini, where, "Baudrate", source.get("baudrate"))
    return node_id, {} if baudrate is None else {"Baudrate": str(baudrate)}


def _object_tree(ini: IniText) -> dict[str, set[int]]:
    """Return every object that has a section of its own or of a sub-object, with its sub-indices."""
    tree: dict[str, set[int]] = {}
    for name in ini.sections:
        if _OBJECT.fullmatch(name):
            tree.setdefault(name, set())
        elif match := _SUBOBJECT.fullmatch(name):
            if match[1] not in ini.sections:
                ini.warn(f"[{match[1]}]", "is missing, but has sub-objects; read as a RECORD")
            tree.setdefault(match[1], set()).add(int(match[2], 16))
    return tree


def _sub_section(ini: IniText, index: str, subindex: int) -> tuple[str, dict[str, str]]:
    names = (f"{index}sub{subindex:x}", f"{index}sub{subindex:02x}", f"{index}sub0x{subindex:x}")
    name = next((name for name in names if name in ini.sections), names[0])
    return f"[{name}]", ini.sections.get(name, {})


def _object(ini: IniText, index: str, subindices: list[int]) -> Sections:
    source = ini.sections.get(index, {})
    where = f"[{index.upper()}]"
    object_type = _object_type(ini, where, source, bool(subindices))
    section = index.upper()
    if object_type in (ObjectType.ARRAY, ObjectType.RECORD):
        repaired = {
            section: {
                "ParameterName": _name(ini, where, source, section),
                "ObjectType": str(int(object_type)),
            }
        }
        if not subindices:
            ini.warn(
                where, f"is an {object_type.name} without sub-objects; nothing of it can be read or written"
            )
    else:
        repaired = {section: _variable(ini, where, source, section, object_type)}
    for subindex in subindices:
        sub_where, sub_source = _sub_section(ini, index, subindex)
        sub_name = f"{section}sub{subindex:X}"
        repaired[sub_name] = _variable(ini, sub_where, sub_source, sub_name, ObjectType.VAR, subindex)
    return repaired


def _object_type(ini: IniText, where: str, source: dict[str, str], has_subobjects: bool) -> ObjectType:
    text = source.get("objecttype", "")
    number = OBJECT_TYPE_BY_NAME.get(text.upper(), parse_integer(text))
    likely = ObjectType.RECORD if has_subobjects else ObjectType.VAR
    if number is None or number not in list(ObjectType):
        if has_subobjects or text:
            ini.note(f"{where} ObjectType", f"{text!r} is no object type; read as {likely.name}")
        return likely
    object_type = ObjectType(number)
    if text.upper() in OBJECT_TYPE_BY_NAME:
        ini.note(f"{where} ObjectType", f"the name {text!r} stands for the number {int(object_type)}")
    if has_subobjects and object_type not in (ObjectType.ARRAY, ObjectType.RECORD):
        ini.warn(f"{where} ObjectType", f"is {object_type.name}, but has sub-objects; read as RECORD")
        return ObjectType.RECORD
    return object_type


def _name(ini: IniText, where: str, source: dict[str, str], section: str) -> str:
    name = source.get("parametername", "")
    if not name:
        ini.note(f"{where} ParameterName", f"is missing; called {section!r}")
    return name or section


def _variable(
    ini: IniText,
    where: str,
    source: dict[str, str],
    section: str,
    object_type: ObjectType,
    subindex: int = 0,
) -> dict[str, str]:
    """Return the keys of one variable, every one in a spelling that the importer takes."""
    is_count = subindex == 0 and "sub" in section
    data_type = _data_type(ini, where, source, object_type, is_count)
    variable = {
        "ParameterName": _name(ini, where, source, section),
        "ObjectType": str(int(object_type if object_type is not ObjectType.RECORD else ObjectType.VAR)),
        "DataType": f"0x{data_type:04X}",
        "AccessType": _access_type(ini, where, source),
        "PDOMapping": str(int(bool(parse_integer(source.get("pdomapping", "0"))))),
    }
    for key in ("LowLimit", "HighLimit", "DefaultValue", "ParameterValue"):
        text = source.get(key.lower(), "")
        value, fault = canonical(text, DATA_TYPES[data_type])
        if value is not None:
            variable[key] = value
        if fault:
            ini.warn(f"{where} {key}", fault)
    for key in ("Factor", "Unit", "Description", "StorageLocation"):
        if source.get(key.lower()):
            variable[key] = source[key.lower()]
    return variable


def _data_type(
    ini: IniText, where: str, source: dict[str, str], object_type: ObjectType, is_count: bool
) -> int:
    text = source.get("datatype", "")
    number = DATA_TYPE_BY_NAME.get(text.upper(), parse_integer(text))
    if number is not None and number > max(DATA_TYPES):
        number = parse_integer(ini.sections.get(f"{number:x}sub1", {}).get("defaultvalue", ""))
    if number in DATA_TYPES:
        return number
    if object_type is ObjectType.DOMAIN:
        return DOMAIN
    if is_count:
        ini.note(f"{where} DataType", f"{text!r} is no data type; a number of entries is UNSIGNED8")
        return DATA_TYPE_BY_NAME["UNSIGNED8"]
    ini.warn(f"{where} DataType", f"{text!r} is no known data type; its values are plain bytes")
    return DOMAIN


def _access_type(ini: IniText, where: str, source: dict[str, str]) -> str:
    text = source.get("accesstype", "").replace(" ", "").lower()
    if text in _ACCESS_TYPES:
        return text
    ini.warn(f"{where} AccessType", f"{text!r} is no access type; taken as read-only")
    return "ro"


def _check_lists(ini: IniText, tree: dict[str, set[int]]) -> None:
    for name in _LISTS:
        listed = (value for key, value in ini.sections.get(name, {}).items() if key.isdigit())
        indices = (parse_integer(value) for value in listed)
        absent = [f"0x{index:04X}" for index in indices if index is not None and f"{index:04x}" not in tree]
        if absent:
            ini.note(f"[{name}]", f"lists objects without a section: {', '.join(absent)}")


def _check_sections(ini: IniText) -> None:
    """Tell of sections that look like objects, and of modules' objects: nobody reads them."""
    for name in ini.sections:
        if _MODULES.match(name):
            ini.warn(f"[{name}]", "describes an object of a plug-in module, which is not read")
        elif _LIKE_AN_OBJECT.match(name) and not _READ.fullmatch(name):
            ini.warn(f"[{name}]", "is no object like [2100] and no sub-object like [2100sub2]; left out")
