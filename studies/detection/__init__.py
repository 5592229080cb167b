"""The studies of detectors: alarms, thresholds, online use, and what follows an alarm."""
