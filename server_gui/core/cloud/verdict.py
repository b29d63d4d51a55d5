"""Result of `verify`: the checks, the problems, and the extent of the proof."""

from collections.abc import Sequence
from dataclasses import dataclass

from gateway.amounts import counted, size
from ml.store.fragments import DataFile
from server_gui.core.cloud.receipt_check import Proof


@dataclass(frozen=True, slots=True)
class Verdict:
    """The checked files, and their problems in words."""

    files: Sequence[DataFile]
    proof: Proof
    problems: Sequence[str]
    notes: Sequence[str] = ()  # what is not wrong, and worth knowing
    rows_unproven: int = 0  # of the files that are whole, rows that no receipt here speaks of

    @property
    def rows(self) -> int:
        """In the newest versions of the tables."""
        return sum(file.rows for file in self.files)

    @property
    def unproven(self) -> str:
        """Number of rows without a receipt, in words; empty without any."""
        rows = self.rows_unproven
        return f"{rows} of {self.rows} rows are proven by no receipt here" if rows > 0 else ""

    @property
    def text(self) -> str:
        """The intact parts, and the extent of their proof, in words."""
        rows = self.rows
        size_bytes = sum(file.size_bytes for file in self.files)
        told = [f"{len(self.files)} files with {rows} rows, {size(size_bytes)}"]
        batches = counted(self.proof.batches, "batch", "batches")
        if self.proof.batches:
            told.append(f"all {self.proof.rows} rows of {batches} by their receipts")
        else:
            told.append("no receipts of it here, so nobody can say whether rows are missing")
        if self.proof.retained:
            told.append(f"{self.proof.retained} rows removed by retention")
        if self.proof.elsewhere:
            told.append(f"{self.proof.elsewhere} batches of this spool went to other stores")
        return "; ".join(told)
