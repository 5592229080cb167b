"""Plug-in contact checkers, their comparison and the guarded stepper."""
