"""The simulated CAN bus and its doors to the outside."""
