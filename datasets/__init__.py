"""Generation of labelled episodes, and loaders of real logs."""
