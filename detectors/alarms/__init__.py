"""Turns scores into alarms, online or in batch, and reports faults of the samples."""
