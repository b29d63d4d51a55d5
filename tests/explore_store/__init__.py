"""Plays what may happen on the way of a row, and looks whether each arrives once and in its right name."""
