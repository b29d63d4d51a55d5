"""Insoles and trunk IMU, encoded from their manuals."""
