"""Plantar-pressure insoles on serial ports."""
