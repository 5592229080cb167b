"""The Gymnasium core: compiled scenes, batches of simulation states, tasks, environments."""
