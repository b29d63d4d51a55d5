"""Replay: recordings of a CAN bus and of serial ports, played as a robot with their timing."""
