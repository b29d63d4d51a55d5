"""Three newcomers walk through the window on the real simulated robot, with a real mouse and real keys."""
