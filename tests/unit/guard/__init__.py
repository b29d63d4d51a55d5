"""Unit tests of the guard's parts that need no gateway."""
