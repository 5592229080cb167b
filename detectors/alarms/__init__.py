"""From scores to alarms: online and in batch, with faults of the samples."""
