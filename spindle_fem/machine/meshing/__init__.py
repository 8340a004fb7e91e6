"""Curved tetrahedral meshes with named parts, surfaces and joints."""
