"""Alarms matched with the truth, and the metrics that follow."""
