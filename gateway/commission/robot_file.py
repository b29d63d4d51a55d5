"""Write a robot's file, keep the one before beside it, and put the findings into the journal."""

import os
import shutil
from pathlib import Path
from typing import Any

from gateway.config.reading import Examined, examine
from gateway.config.robot import RobotConfig
from gateway.records import durable
from gateway.records.records import Records

BEFORE = ".before"


def write(file: Path, made: str) -> Examined:
    """Write the text where `file` points, with its owner kept, and return its check; raises `OSError`."""
    there, like = file.resolve(), None
    if there.exists():
        shutil.copyfile(there, there.with_name(there.name + BEFORE))
        seen = there.stat()
        like = seen if os.geteuid() in (0, seen.st_uid) else None  # another's is ours from now on
    durable.write(there, made.encode(), like)
    return examine(file)


def journal(config: RobotConfig, who: str, what: str, **found: Any) -> str:
    """Append an entry to the robot's journal; return why not, in words, where that fails."""
    records = Records(config.records)
    try:
        records.journal.append(who, what, file=str(config.path), **found).result()
    except OSError as error:
        return f"  It is not in the journal: {error.strerror or error}\n"
    finally:
        records.close()
    return ""
