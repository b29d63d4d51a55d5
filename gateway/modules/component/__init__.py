"""The component module: buses, drives, insoles and IMUs, from first use to last."""
