"""Measured recordings: manifests, files with their defects, a common time grid."""
