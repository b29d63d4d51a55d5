"""The desk's commands, one file a command."""
