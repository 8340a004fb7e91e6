"""Steady states and transients of a machine: loads and temperatures made to agree."""
