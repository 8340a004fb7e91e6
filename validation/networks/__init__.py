"""Concealed networks: machines known by nodes and links only, by a modal solver of their own."""
