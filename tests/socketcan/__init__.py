"""The drivers on real SocketCAN: where the interface vcan0 is up, as `tests/socketcan/uml` arranges it."""
