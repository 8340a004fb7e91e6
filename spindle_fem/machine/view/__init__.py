"""Information on a machine for commands and effects: its places, parts and usual sizes."""
