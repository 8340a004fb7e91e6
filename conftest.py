"""What pytest leaves alone on this machine."""

from importlib.util import find_spec

# Compiled kernels can only be imported, doctests included, where numba is.
collect_ignore_glob = [] if find_spec("numba") else ["spindle_fem/conduction/*compiled*.py"]
