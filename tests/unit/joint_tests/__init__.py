"""What a joint's test measures, against truths."""
