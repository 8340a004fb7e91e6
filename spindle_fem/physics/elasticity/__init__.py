"""Elastic constants of solids and of walls that a channel has weakened."""
