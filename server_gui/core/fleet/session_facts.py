"""What is so when a session begins, from what the robot and this program say of themselves."""

import hashlib
import importlib.metadata

import msgspec
from msgspec import UNSET
from msgspec.structs import replace

from gateway.wire.framing import PROTOCOL
from gateway.wire.resource import KernelFacts
from gateway.wire.robot import Description
from server_gui.core.recording.records import NOBODY, Facts, Worn


def facts(description: Description, operator: str, notes: str, worn: Worn = NOBODY) -> Facts:
    """Return what a session can begin with; parameters' values and the robot's kernel become known later."""
    return Facts(
        configuration_hash=configuration_hash(description),
        units={channel.name: channel.unit for channel in description.channels},
        versions=versions(description),
        operator=operator,
        notes=notes,
        worn=worn,
    )


def versions(description: Description) -> dict[str, str]:
    """Of the software that takes part, as far as it is known."""
    known = {"gwrms collect": importlib.metadata.version("gwrms"), "protocol": str(PROTOCOL)}
    return known if description.version is None else known | {"gateway": description.version}


def kernel(known: KernelFacts) -> dict[str, str]:
    """Return the robot's operating system among the versions."""
    return {"robot's kernel": " ".join((known.system, known.release, known.version))}


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
