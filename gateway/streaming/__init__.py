"""Streams: sources of samples, batches of rows, and each subscriber's end."""
