"""Steady designs of one geometry by a projected model: thousands at once."""
