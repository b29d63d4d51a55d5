"""Following a robot: its link, what it sends once that is checked, and its state as of now."""
