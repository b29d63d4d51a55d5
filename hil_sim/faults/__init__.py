"""Faults on demand: what can break, what it looks like from outside, and who breaks it."""
