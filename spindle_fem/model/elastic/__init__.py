"""Elasticity of the bodies of a machine: what temperatures, fits and rotation do to its shape."""
