"""Alarms matched with the truth, and the figures that follow."""
