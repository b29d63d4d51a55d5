"""Models: train, compare, promote, roll back; what is changed is said and confirmed before."""
