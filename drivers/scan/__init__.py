"""Scan of an unknown CAN bus: by listening, then, on request, by reading. Nothing is ever written."""
