"""EDS and DCF files: finding them, and loading those that vendors really ship (CiA 306).

    description = eds.load(eds.locate("joint_drive.eds", beside=config_path), node_id=5)
    for finding in description.findings: ...

Importing this package costs nothing; canopen is imported with the first file that is loaded.
"""

from pathlib import Path

from eds.description import Description, EdsError, Finding
from eds.shipped import locate

__all__ = ["Description", "EdsError", "Finding", "load", "locate"]


def load(path: Path, node_id: int) -> Description:
    """Load an EDS or DCF file for the node `node_id` (1–127), repaired where it is broken in a known way.

    The configured node id counts: what a DCF says for another node is made this node's, and reported.
    Raises `EdsError` for a file that is not there, is no EDS, or is broken beyond repair.
    """
    from eds.loader import load_file  # canopen is heavy, and not everybody loads a file

    return load_file(path, node_id)
