"""What the doctor looks at, gathered once: nothing here judges, enables or moves."""
