"""The list of robots: add, pair, remove, stop and reset one."""
