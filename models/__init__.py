"""What is simulated: the arm, its drive train, obstacles and the scene composer."""
