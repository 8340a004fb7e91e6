"""Parts, faces, contacts and the channel of a machine, and their OpenCASCADE solids."""
