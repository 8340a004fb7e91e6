"""Machines in time: heat, films, coolant and preload coupled while the inputs change."""
