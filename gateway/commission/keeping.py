"""A robot's file is written: the one before is kept beside it, and what was found goes into the journal."""

import os
import shutil
from pathlib import Path
from typing import Any

from gateway.config.reading import Examined, examine
from gateway.config.robot import RobotConfig
from gateway.records import durable
from gateway.records.records import Records

BEFORE = ".before"


def put(file: Path, made: str) -> Examined:
    """Write it where `file` leads, as whose it was, and say what it is worth; raises `OSError`."""
    there, like = file.resolve(), None
    if there.exists():
        shutil.copyfile(there, there.with_name(there.name + BEFORE))
        seen = there.stat()
        like = seen if os.geteuid() in (0, seen.st_uid) else None  # another's is ours from now on
    durable.write(there, made.encode(), like)
    return examine(file)


def journal(config: RobotConfig, who: str, what: str, **found: Any) -> str:
    """Put it into the robot's journal; what is in the way of that is told, no more."""
    records = Records(config.records)
    try:
        records.journal.append(who, what, file=str(config.path), **found).result()
    except OSError as error:
        return f"  It is not in the journal: {error.strerror or error}\n"
    finally:
        records.close()
    return ""
