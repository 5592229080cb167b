"""The study of deformable collision detection beside ipctk."""
