"""What commands and effects ask about a machine: its places, parts and usual sizes."""
