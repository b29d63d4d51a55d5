"""Facts at the start of a session, from the robot and this program."""

import hashlib
import importlib.metadata
from collections.abc import Mapping
from typing import Final

import msgspec
from msgspec import UNSET
from msgspec.structs import replace

from gateway.amounts import NONE
from gateway.wire.framing import PROTOCOL
from gateway.wire.parameter import ParameterInfo
from gateway.wire.resource import KernelFacts
from gateway.wire.robot import Description
from ml.store.sessions import OBJECT
from server_gui.core.recording.records import NOBODY, RECORDER, Facts, Worn

ENABLED: Final = "operation enabled"  # the word of a drive's state in which it follows its target
NO_FILE: Final = "no file"
DIGITS: Final = 12  # of a digest: enough to tell two files of a robot apart
IDENTITY: Final = {  # CiA 301
    "0X1009:0": "hardware",
    "0X100A:0": "firmware",
    "0X1018:1": "vendor",
    "0X1018:2": "product",
    "0X1018:3": "revision",
    "0X1018:4": "serial number",
}


def facts(description: Description, operator: str, notes: str, worn: Worn = NOBODY) -> Facts:
    """Return the facts at the start of a session; parameters and the robot's kernel become known later."""
    return Facts(
        configuration_hash=configuration_hash(description),
        units={channel.name: channel.unit for channel in description.channels},
        versions=versions(description),
        operator=operator,
        notes=notes,
        worn=worn,
        setup=setup(description),
    )


def versions(description: Description) -> dict[str, str]:
    """Return the versions of the software that takes part, as far as they are known."""
    known = {RECORDER: importlib.metadata.version("gwrms"), "protocol": str(PROTOCOL)}
    return known if description.version is None else known | {"gateway": description.version}


def kernel(known: KernelFacts) -> dict[str, str]:
    """Return the robot's operating system among the versions."""
    return {"robot's kernel": " ".join((known.system, known.release, known.version))}


def setup(description: Description) -> dict[str, str | float]:
    """Return the set-up by the robot's file: EDS files, calibration of joints, limits, guard."""
    found: dict[str, str | float] = {}
    if description.file is not None:
        found["robot.toml/digest"] = description.file[:DIGITS]
    for part in description.components:
        found[f"component/{part.name}"] = part.kind
        if isinstance(part.device, dict):
            digest = str(part.device.get("eds_digest", ""))[:DIGITS]
            found[f"EDS/{part.name}"] = f"{part.device.get('eds', '')} {digest}".strip()
        if part.angle is not UNSET:
            found[f"zero/{part.name}"] = part.angle.zero_offset
            found[f"scale/{part.name}"] = part.angle.rad_per_count
        if part.calibration is not UNSET:
            found[f"calibration/{part.name}"] = part.calibration or NO_FILE
    for known in description.parameters:
        found[f"{OBJECT}{known.name}"] = f"{known.object} {known.unit}".rstrip()
        if known.read_only is None:
            found[f"limits/{known.name}"] = _limits(known)
    for rule in description.guard.rules:
        found[f"guard/{rule.name}"] = f"{rule.watch} {rule.limit}: {', '.join(rule.actions)}"
    for channel in description.channels:
        if isinstance(channel.enum, dict):
            numbers = [number for number, word in channel.enum.items() if word == ENABLED]
            found[f"enabled/{channel.name}"] = ",".join(numbers)
    return found


def _limits(known: ParameterInfo) -> str:
    ends = (NONE if one is None else f"{one:.10g}" for one in (known.min, known.max))
    step = "" if known.max_step is None else f", steps of {known.max_step:.10g}"
    return f"{' … '.join(ends)} {known.unit}".rstrip() + step


def identities(devices: Mapping[str, Mapping[str, str]]) -> dict[str, str]:
    """Return the identities of the devices, as read from them."""
    return {
        f"{section}/{component}": said
        for component, told in devices.items()
        for place, section in IDENTITY.items()
        if place in told
        for said in [told[place]]
    }


def configuration_hash(description: Description) -> str:
    """SHA-256 of what the robot's file says, as far as the robot tells it, without what changes by itself."""
    parts = [
        description.role,
        [
            replace(known, state="", problem=None, findings=UNSET, emcy=UNSET)
            for known in description.components
        ],
        [replace(known, problem=None) for known in description.parameters],
        [
            replace(rule, state="", since_ns=None, reason=None, trips=0, problems=[])
            for rule in description.guard.rules
        ],
        description.guard.heartbeat_ms,
        description.stop.fallbacks,
    ]
    return hashlib.sha256(msgspec.json.encode(parts, order="deterministic")).hexdigest()
