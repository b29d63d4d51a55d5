"""What the repository is kept with: what draws the reference, makes the pictures and measures a store."""
