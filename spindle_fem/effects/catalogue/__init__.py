"""Catalogue of effects, one file per effect; a new file is a new effect."""
