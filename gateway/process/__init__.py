"""The gateway as a process: its loop, memory, rest, start and service manager."""
