"""The studies of what a scene, an environment and a blow cost, and how exact they are."""
