"""The studies of contact checkers and of guarded steps beside MuJoCo."""
