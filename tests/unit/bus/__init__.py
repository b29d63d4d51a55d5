"""The CANopen bus."""
