"""The window: widgets that show what a `Desk` knows and emit what people want. None talks to the network."""
