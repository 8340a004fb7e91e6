"""The machine as geometry, mesh and named places; no temperatures yet."""
