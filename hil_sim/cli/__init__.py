"""The simulator's commands: `gwrms sim` and `gwrms sim-fault`."""
