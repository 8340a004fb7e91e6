"""Compiled loops of the finite-element model.

Kernels work on a range of rows ``[low, high)`` and write to these rows alone, so that threads share
them (:mod:`spindle_fem.model.mesh.threads`) and the result depends on the ranges, never on timing.
Indices are passed as unsigned 32-bit integers: signed ones are tested for "from the end" at every
access. numba keeps compiled code beside the module or, where that is not writable, in the user's
cache; ``python -m spindle_fem.model.mesh.kernels.compile`` fills it.
"""

# numba's options: kept on disk, run without the interpreter's lock, division by zero as in numpy.
OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
# Also allow sums in any order, which vector instructions need.
FAST = {**OPTIONS, "fastmath": {"contract", "reassoc", "nsz", "arcp"}}
