"""Several values of one parameter, tried one after another on a walking robot: A/B trials and sweeps."""
