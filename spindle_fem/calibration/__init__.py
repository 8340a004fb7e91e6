"""Uncertain parameters fitted to recordings, with what the data can and cannot tell."""
