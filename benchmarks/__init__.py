"""Speed against error: one file a study."""
