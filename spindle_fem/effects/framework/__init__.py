"""Base classes of effects, and the building blocks of the catalogue."""
