"""From scores to alarms: thresholds, confirmation, calibrated false-alarm rates."""
