"""What stands between an environment and its user: wrappers, and other libraries' interfaces."""
