"""Changing a robot's parameters: edits, lease, writes, trials, flash, and the stop."""
