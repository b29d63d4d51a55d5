"""The parameters panel: tree of values and edits, the chosen one, the review, the trial, the lease."""
