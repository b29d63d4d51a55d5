"""`gwrms eds`: show and check an EDS or DCF file."""

import argparse
import json
import sys
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

import eds
from eds.description import Description, EdsError
from eds.profile import profile_of
from eds.report import ObjectRow, PdoRow, grouped_findings, joint_text, object_rows, pdo_rows
from eds.table import joint_table

_DESCRIPTION = """\
Read EDS and DCF files (CiA 306) as a gateway would: the device, whether it can be a joint, its PDOs as the
file's defaults have them (a gateway reads them from the device itself), its objects with limits, what had to
be repaired, and the table for robot.toml, to paste; what the file does not tell is a comment to fill in.
"""

_EPILOG = """\
exit status
  0 when every file can be used, 1 when one cannot, 2 for wrong usage

examples
  gwrms eds joint_drive.eds
  gwrms eds --brief *.eds *.dcf
  gwrms eds --json --node-id 5 drive.eds
"""


def _node_id(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= 127:
        raise argparse.ArgumentTypeError(f"{text} is no node id: give a number from 1 to 127")
    return int(text)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="gwrms eds",
        description=_DESCRIPTION,
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "files",
        nargs="+",
        metavar="FILE",
        type=Path,
        help="an .eds or .dcf file, or the name of a shipped one",
    )
    parser.add_argument(
        "--node-id",
        type=_node_id,
        metavar="N",
        help="node id for COB-IDs that depend on it (1), and the table",
    )
    parser.add_argument("--brief", action="store_true", help="leave out the objects")
    parser.add_argument("--json", action="store_true", help="print one JSON object per file, a line each")
    return parser


def main(argv: list[str]) -> int:
    """Report each file; one that cannot be used does not hide the others."""
    arguments = _parser().parse_args(argv)
    failed = False
    for path in arguments.files:
        try:
            description = eds.load(eds.locate(str(path), Path.cwd() / "here"), arguments.node_id or 1)
        except EdsError as error:
            failed = True
            sys.stderr.write(f"gwrms eds: {error}\n")
            continue
        table = joint_table(description, arguments.node_id)
        if arguments.json:
            told = {**_as_json(description, brief=arguments.brief), "table": table}
            sys.stdout.write(json.dumps(told) + "\n")
        else:
            said = "\n".join(_as_text(description, brief=arguments.brief))
            sys.stdout.write(f"{said}\n  for robot.toml\n\n{table}\n")
    return int(failed)


def _as_json(description: Description, *, brief: bool) -> dict[str, object]:
    return {
        "file": str(description.path),
        "vendor": description.vendor,
        "product": description.product,
        "vendor_id": description.vendor_id,
        "product_code": description.product_code,
        "joint": joint_text(description),
        "profile": _profile_json(description),
        "pdos": [asdict(row) for row in pdo_rows(description)],
        "findings": [asdict(finding) for finding in description.findings],
        **({} if brief else {"objects": [_object_json(row) for row in object_rows(description)]}),
    }


def _profile_json(description: Description) -> dict[str, object] | None:
    profile = profile_of(description)
    if profile is None:
        return None
    quantities, gains = profile.found(description)
    return {
        "name": profile.name,
        "quantities": {name: asdict(one) for name, one in quantities.items()},
        "gains": {name: asdict(one) for name, one in gains.items()},
        "quirks": [asdict(one) for one in profile.quirks],
    }


def _object_json(row: ObjectRow) -> dict[str, object]:
    return {key: value.hex() if isinstance(value, bytes) else value for key, value in asdict(row).items()}


def _as_text(description: Description, *, brief: bool) -> Iterator[str]:
    rows = list(object_rows(description))
    yield str(description.path)
    vendor, product = description.vendor or "vendor unknown", description.product or "product unknown"
    yield f"  device      {vendor}: {product}"
    yield f"  identity    vendor {_hex(description.vendor_id)}, product {_hex(description.product_code)}"
    yield f"  a joint?    {joint_text(description)}"
    yield from _profile_text(description)
    yield f"  objects     {len({row.index for row in rows})} with {len(rows)} values"
    yield "  PDO defaults"
    yield from (_pdo_text(row, description) for row in pdo_rows(description))
    if not brief:
        yield "  objects: index, type, access, limits, default"
        yield from (_object_text(row) for row in rows)
    yield "  findings"
    findings = grouped_findings(description)
    for severity, where, text, often in findings:
        yield f"    {severity:<8}{where} {text}" + (f" (and {often - 1} more alike)" if often > 1 else "")
    if not findings:
        yield "    none"


def _profile_text(description: Description) -> Iterator[str]:
    """Yield the matching profile, the device's part of it, and its source."""
    profile = profile_of(description)
    if profile is None:
        yield "  profile     none fits: it is read by its EDS and CiA 402 alone"
        return
    yield f"  profile     {profile.name}"
    quantities, gains = profile.found(description)
    for title, objects in (("has", quantities), ("gains", gains)):
        if objects:
            yield f"    {title:<10}{', '.join(f'{name} {one.name}' for name, one in objects.items())}"
    yield from (f"    note      {one.text}" for one in profile.quirks)
    yield from (f"    source    {one}" for one in profile.sources)


def _hex(number: int | None) -> str:
    return "unknown" if number is None else f"0x{number:X}"


def _pdo_text(row: PdoRow, description: Description) -> str:
    names = []
    for index, subindex, bits in row.mapped:
        variable = description.variable(index, subindex)
        names.append(f"{index:04X}:{subindex:02X} {variable.qualname if variable else '?'} ({bits} bits)")
    state = " disabled" if row.enabled is False else ""
    mapped = ", ".join(names) or "empty"
    kind = "unknown" if row.transmission_type is None else row.transmission_type
    return f"    {row.name:<6} {_hex(row.cob_id):<11} type {kind}{state}: {mapped}"


def _object_text(row: ObjectRow) -> str:
    limits = (
        ""
        if row.minimum is None and row.maximum is None
        else f"[{_bound(row.minimum)} … {_bound(row.maximum)}]"
    )
    default = "" if row.default is None else f"= {_value(row.default)}"
    configured = "" if row.value is None else f" (DCF: {_value(row.value)})"
    left = f"    {row.index:04X}:{row.subindex:02X} {row.data_type:<15}{row.access:<6}"
    return f"{left}{row.name}  {limits}{' ' if limits else ''}{default}{configured}".rstrip()


def _bound(limit: float | None) -> str:
    return "" if limit is None else str(limit)


def _value(value: object) -> str:
    return value.hex(" ") if isinstance(value, bytes) else str(value)
