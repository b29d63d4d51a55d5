"""What draws the references and makes the figures of the docs."""
