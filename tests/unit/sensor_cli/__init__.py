"""Tests: `gwrms sensor` and `gwrms calibrate`."""
