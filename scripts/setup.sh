#!/usr/bin/env bash
# Virtual environment, wheels, and the system libraries that gmsh and VTK load.
set -euo pipefail

python=${PYTHON:-python3}
venv=${VENV:-.venv}
# What the gmsh wheel links to, and a software OpenGL for pictures without a screen.
libraries="libgl1 libglu1-mesa libegl1 libgl1-mesa-dri libxrender1 libxcursor1 libxfixes3 libxft2 libxinerama1 libfontconfig1 libgomp1"

say() { printf '%s\n' "$*" >&2; }

install_packages() {
    if [ "$(id -u)" -ne 0 ] || ! command -v apt-get >/dev/null; then
        say "These Debian packages are needed: $*"
        say "Installing them needs root. Run:  sudo apt-get install $*"
        say "and call make again."
        exit 1
    fi
    apt-get update -qq
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@"
}

if ! command -v "$python" >/dev/null; then
    say "$python was not found; Python 3.11 or later is needed (make PYTHON=/path/to/python)."
    exit 1
fi
"$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || {
    say "$("$python" --version) is too old; Python 3.11 or later is needed."
    exit 1
}
"$python" -c 'import ensurepip, venv' 2>/dev/null || install_packages python3-venv

say "Installing spindle_fem and what it needs into $venv; a few minutes the first time ..."
[ -x "$venv/bin/python" ] || "$python" -m venv "$venv"
"$venv/bin/python" -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[test,cluster,optimise]'

# What a first run would wait for: compiled while the pictures' libraries are checked.
say "Compiling the kernels of the finite elements ..."
"$venv/bin/python" -m spindle_fem.model.mesh.kernels.compile &
compiling=$!

works() { "$venv/bin/python" -c 'import gmsh, vtk, pyvista as pv
p = pv.Plotter(off_screen=True, window_size=(64, 64)); p.add_mesh(pv.Sphere()); p.screenshot(None)' >/dev/null 2>&1; }
if ! works; then
    say "Installing the system libraries of gmsh and VTK ..."
    # shellcheck disable=SC2086
    install_packages $libraries
    works || {
        say "gmsh or VTK still cannot be loaded:"
        "$venv/bin/python" -c 'import gmsh, vtk, pyvista' || true
        exit 1
    }
fi

wait "$compiling"
say "Ready: $venv/bin/spindle-fem, or after  source $venv/bin/activate  spindle-fem alone."
