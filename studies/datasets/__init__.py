"""Generation of datasets: what it costs and where, what it writes, and what a kill leaves."""
