"""Lumped thermal networks: nodes with capacity, links, boundaries, sources."""
