"""Tests: the serial port and what shares it."""
