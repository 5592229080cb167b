"""The arm as numbers: rigid bodies, friction, drive gains."""
