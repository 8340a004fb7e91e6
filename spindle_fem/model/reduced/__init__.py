"""Fast model of a machine with geometry: Galerkin projection of the finite-element model."""
