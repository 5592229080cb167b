"""The typed values that flow through tauguard, and their MCAP form."""
