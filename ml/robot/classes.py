"""Classes of a robot's own models, task by task: the names alone, which need no library.

They stand in task.py too, with the sensors that it takes to tell them. Its text is part of every model's
fingerprint, so it cannot take them from here without making all models be learned again.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

ABNORMAL: Final = "abnormal"
CLASSES: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType(
    {
        "activity": (
            "stand",
            "walk",
            "sit",
            "sit_to_stand",
            "stand_to_sit",
            "turn",
            "stairs_up",
            "stairs_down",
            "ramp",
        ),
        "gait_phase": ("stride",),
        "falling": ("steady", "near_fall", "fall"),
    }
)
