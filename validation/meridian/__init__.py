"""A second model of machines with geometry: finite elements in the meridian plane."""
