"""The bill of materials of a release, from the lock file: CycloneDX 1.5, JSON (https://cyclonedx.org/docs/1.5/json/).

Everything that any extra may bring is in it, each with the checksums of the files that may be installed.
"""

import re
import uuid
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any, Final

_PACKAGE: Final = re.compile(r"([A-Za-z0-9_.-]+)==([^ ;\\]+)(?: *; *([^\\]*?))? *\\?$")
_HASH: Final = re.compile(r"--hash=sha256:([0-9a-f]{64})")
_VIA: Final = re.compile(r"# +(?:via +)?([A-Za-z0-9_.-]+)(?: \(.*\))?$")
OWN: Final = "gwrms"


@dataclass(slots=True)
class Package:
    """A line of the lock file, with what stands below it."""

    name: str
    version: str
    marker: str = ""
    hashes: list[str] = field(default_factory=list)
    via: list[str] = field(default_factory=list)

    @property
    def purl(self) -> str:
        """As it is called everywhere (https://github.com/package-url/purl-spec)."""
        return f"pkg:pypi/{self.name.lower().replace('_', '-')}@{self.version}"


def packages(lock: str) -> list[Package]:
    """Return every package of a lock file as `uv pip compile --generate-hashes` writes it.

    Raises:
        ValueError: a line that cannot be read, so that nothing is left out in silence.

    """
    found: list[Package] = []
    for number, line in enumerate(lock.splitlines(), 1):
        text = line.strip()
        if not text or text == "# via":
            continue
        if not line.startswith((" ", "#")) and (named := _PACKAGE.fullmatch(text)):
            found.append(Package(named[1], named[2], (named[3] or "").strip()))
        elif found and (checksum := _HASH.match(text)):
            found[-1].hashes.append(checksum[1])
        elif found and (via := _VIA.fullmatch(text)):
            found[-1].via.append(via[1])
        else:
            raise ValueError(f"line {number} of the lock file is no package, checksum or reason: {text!r}")
    return found


def bill(version: str, epoch_s: int, lock: str) -> dict[str, Any]:
    """Return the whole document; the same for the same release, whenever and wherever it is made."""
    known = packages(lock)
    own = f"pkg:pypi/{OWN}@{version}"
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "serialNumber": f"urn:uuid:{uuid.uuid5(uuid.NAMESPACE_URL, own + lock)}",
        "version": 1,
        "metadata": {
            "timestamp": datetime.fromtimestamp(epoch_s, UTC).isoformat(),
            "component": {
                "type": "application",
                "bom-ref": own,
                "name": OWN,
                "version": version,
                "purl": own,
                "licenses": [{"license": {"id": "Apache-2.0"}}],
            },
        },
        "components": [_component(package) for package in known],
        "dependencies": list(_dependencies(own, known)),
    }


def _component(package: Package) -> dict[str, Any]:
    files = {
        "type": "distribution",
        "url": f"https://pypi.org/project/{package.name}/{package.version}/",
        "hashes": [{"alg": "SHA-256", "content": each} for each in package.hashes],
    }
    made: dict[str, Any] = {
        "type": "library",
        "bom-ref": package.purl,
        "name": package.name,
        "version": package.version,
        "purl": package.purl,
        "externalReferences": [files],
    }
    if package.marker:
        made["properties"] = [{"name": "gwrms:only-where", "value": package.marker}]
    return made


def _dependencies(own: str, known: Sequence[Package]) -> Iterator[dict[str, Any]]:
    """Yield the dependencies of each package; of one with several versions, those of all of them."""
    for name, ref in [(OWN, own), *((package.name, package.purl) for package in known)]:
        yield {"ref": ref, "dependsOn": sorted(package.purl for package in known if name in package.via)}
