"""Commands for one sensor at a time: `gwrms sensor` and `gwrms calibrate`."""
