"""How each library is asked: one adapter a file."""
