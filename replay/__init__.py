"""Playback of traces in rerun."""
