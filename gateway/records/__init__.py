"""Durable records: the journal, the held stop, and writes to be reverted."""
