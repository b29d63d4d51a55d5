"""A robot's file for a computer that does much else: what answers late is not taken for silent."""

import re
from collections.abc import Collection
from pathlib import Path

PATIENT_S = 30.0
_TABLE = re.compile(r"^\[(joint|device)\.(\w+)\].*$", re.MULTILINE)


def patient(file: Path, but: Collection[str] = (), patience_s: float = PATIENT_S) -> Path:
    """Let the gateway wait so long for every node's answers, `but` for those of these components."""

    def waits(table: "re.Match[str]") -> str:
        kind, name = table.groups()
        if name in but:
            return table[0]
        stop = f"\nstop_timeout_s = {patience_s}" if kind == "joint" else ""
        return f"{table[0]}\nsdo_timeout_s = {patience_s}{stop}"

    text = file.read_text(encoding="utf-8")
    if "sdo_timeout_s" not in text:
        file.write_text(_TABLE.sub(waits, text), encoding="utf-8")
    return file
