"""Thermal design of grease-lubricated machine-tool spindles by finite elements."""

__version__ = "0.1.0"
