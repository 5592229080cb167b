"""After an alarm: link, force, and kind of contact."""
