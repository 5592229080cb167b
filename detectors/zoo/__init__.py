"""Every detector that can be asked for by its name, behind the interface of `detector`."""
