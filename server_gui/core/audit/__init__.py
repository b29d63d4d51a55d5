"""A robot's journal at the desk: who did what to it, and whether the record is whole."""
