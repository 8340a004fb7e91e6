"""Compiled loops of the finite-element model."""
