"""The CANopen bus that joints and other devices share."""
