"""Trunk IMUs on serial ports."""
