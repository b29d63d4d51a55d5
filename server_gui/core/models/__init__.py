"""Learned models, as window and commands look at them: named, compared, trained, promoted, rolled back."""
