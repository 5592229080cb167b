"""After the alarm: which link, which force, where, and what kind of contact it is."""
