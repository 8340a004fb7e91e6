#!/usr/bin/env bash
# Build the wheel, install it with its dependencies into an empty environment, and do README's first hour there.
set -euo pipefail

python=$(realpath -s "$1")
source=$PWD
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

"$python" -m pip wheel --quiet --disable-pip-version-check --no-deps --wheel-dir "$work" .
"$python" -m venv "$work/venv"
"$work/venv/bin/python" -m pip install --quiet --disable-pip-version-check "$work"/*.whl
export HOME="$work/home" XDG_CACHE_HOME="$work/cache"
unset PYTHONPATH SPINDLE_FEM_CACHE
mkdir -p "$HOME" "$work/own"
cd "$work/own"
spindle_fem="$work/venv/bin/spindle-fem"
coarse=(--set mesh.preset=coarse)
"$spindle_fem" new -o machine.toml
"$spindle_fem" check machine.toml --picture machine.png >checked.txt
"$spindle_fem" run machine.toml -o results "${coarse[@]}" >run.txt
# What a measuring device writes: semicolons, decimal commas, days before months.
PYTHONPATH="$source" "$work/venv/bin/python" -c \
    "from pathlib import Path; from tests.support.documented_commands import german_csv; german_csv(Path('measured.csv'))"
"$spindle_fem" recording draft measured.csv --machine machine.toml -o recording
"$spindle_fem" simulate machine.toml recording -o simulated "${coarse[@]}" >simulated.txt
"$spindle_fem" diagnose machine.toml recording -o diagnosed "${coarse[@]}" >diagnosed.txt
"$spindle_fem" examples -o mine
# A notebook as jupyter runs it.
"$work/venv/bin/python" -m pip install --quiet --disable-pip-version-check nbconvert ipykernel
"$work/venv/bin/jupyter" nbconvert --log-level ERROR --execute --to html mine/examples/recording_to_diagnosis.ipynb
for file in machine.png results/report.html results/fields.vtu recording/recording.toml simulated/report.html diagnosed/report.html mine/examples/recording_to_diagnosis.html; do
    [ -e "$file" ] || { echo "the first hour lacks $file"; exit 1; }
done
"$work/venv/bin/python" -c "import spindle_fem; print('first hour done with', spindle_fem.__version__)"
