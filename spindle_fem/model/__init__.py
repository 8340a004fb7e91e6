"""Thermal models of a machine: finite elements, their projection, lumped networks."""
