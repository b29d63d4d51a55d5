"""Qt widgets that show and emit, nothing else."""
