"""One adapter a file: how a library is asked."""
