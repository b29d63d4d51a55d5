"""Writes out what an EDS keeps in compact storage (CiA 306-1 §4.6.4): one section for each sub-object.

After that nobody else need know of `CompactSubObj`, `[1A00Name]`, `[1A00Value]` and the like.
"""

from eds.ini import IniText
from eds.numbers import parse_integer

MAX_ENTRIES = 254  # sub-index FFh is the object's own type (CiA 301 §7.4.3)
_OF_THE_OBJECT = ("compactsubobj", "subnumber", "objecttype", "parametername", "parametervalue", "denotation")
# The section behind an object's index, and the key of its entries that each of its lines is.
_LISTS = (("name", "parametername"), ("value", "parametervalue"), ("denotation", "denotation"))


def write_out(ini: IniText) -> None:
    """Replace every compactly stored object of `ini` by its sub-objects; those with sections keep them."""
    for index in [name for name in ini.sections if len(name) == 4]:
        text = ini.sections[index].pop("compactsubobj", "")
        count = parse_integer(text) if text else 0
        if count is None or not 0 <= count <= MAX_ENTRIES:
            ini.warn(f"[{index.upper()}] CompactSubObj", f"is {text!r}, not 0 to 254; no entry is known")
        elif count:
            _write_out(ini, index, count)


def _write_out(ini: IniText, index: str, count: int) -> None:
    parent = ini.sections[index]
    names = ini.sections.pop(f"{index}name", {})
    common = {key: value for key, value in parent.items() if key not in _OF_THE_OBJECT}
    for key in common:
        del parent[key]
    parent.setdefault("objecttype", "8")
    ini.sections.setdefault(f"{index}sub0", _number_of_entries(count))
    for entry in range(1, count + 1):
        name = names.get(str(entry)) or f"{parent.get('parametername', index)}{entry}"
        ini.sections.setdefault(f"{index}sub{entry:x}", {"parametername": name, **common})


def _number_of_entries(count: int) -> dict[str, str]:
    return {
        "parametername": "Number of entries",
        "datatype": "0x0005",
        "accesstype": "ro",
        "defaultvalue": str(count),
    }


def give_values(ini: IniText) -> None:
    """Give entries the values, names and denotations that a DCF lists (`[1A00Value]`), compact or not."""
    for suffix, key in _LISTS:
        for name in [one for one in ini.sections if one[4:] == suffix]:
            _distribute(ini, name, key)


def _distribute(ini: IniText, name: str, key: str) -> None:
    index = name[:4]
    for number, text in ini.sections.pop(name).items():
        if not number.isdecimal() or not text:
            continue
        section = ini.sections.get(f"{index}sub{int(number):x}")
        if section is None:
            ini.warn(f"[{name}] {number}", f"{text!r} is for a sub-object that the file lacks; left out")
        else:
            section.setdefault(key, text)
