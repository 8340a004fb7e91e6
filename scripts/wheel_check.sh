#!/usr/bin/env bash
# Build the wheel, install it away from the source tree and run a small machine with it.
set -euo pipefail

python=$(realpath -s "$1")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

"$python" -m pip wheel --quiet --disable-pip-version-check --no-deps --wheel-dir "$work" .
# Dependencies come from the environment of the tests; spindle_fem only from the wheel.
"$python" -m pip install --quiet --disable-pip-version-check --no-deps --target "$work/site" "$work"/*.whl
cd "$work"
export PYTHONPATH="$work/site"
"$python" -c "import spindle_fem; assert spindle_fem.__file__.startswith('$work/site'), spindle_fem.__file__"
"$python" -m spindle_fem run small_two_start --set mesh.preset=coarse -o "$work/out" --json >"$work/summary.json"
"$python" - "$work" <<'PY'
import json, pathlib, sys

work = pathlib.Path(sys.argv[1])
summary = json.loads((work / "summary.json").read_text())
if abs(summary["energy"]["imbalance_relative"]) > 1e-8:
    sys.exit("the wheel's run does not balance")
missing = [name for name in ("summary.json", "fields.vtu", "result.nc", "report.html", "machine.toml") if not (work / "out" / name).is_file()]
if missing:
    sys.exit(f"the wheel's run lacks {missing}")
import spindle_fem
from spindle_fem.studies.shipped_files import EXAMPLES, find_study, shipped_folder

site = work / "site"
if not (find_study("cool_down").is_relative_to(site) and list(shipped_folder(EXAMPLES).glob("*.py"))):
    sys.exit("the wheel lacks studies or examples")
print(f"wheel {spindle_fem.__version__}: {summary['machine']} solved, hottest {summary['temperature']['max_degC']:.2f} degC")
PY
