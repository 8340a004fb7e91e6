"""Functions of ``import spindle_fem``, which return results to look at, plot and save."""
