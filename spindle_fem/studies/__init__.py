"""Computations behind the commands, one study per command."""
