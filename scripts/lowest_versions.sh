#!/usr/bin/env bash
# The lowest versions that pyproject.toml allows, in an environment of their own, and a sample of the tests on them.
set -euo pipefail

python=$(realpath -s "$1")
venv=${LOWEST:-runs/lowest}
# From definitions to reports: every library of the list is used.
sample="tests/unit/test_units.py tests/unit/test_definition_load.py tests/unit/test_recordings_read.py
    tests/unit/test_parallel.py tests/unit/test_results_field_file.py tests/unit/test_report_outputs.py
    tests/unit/test_results_dataset_and_folder.py tests/unit/test_sweep_results_table.py
    tests/verification/test_conduction_steady.py tests/integration/test_library.py
    tests/integration/test_drafted_exports.py"

[ -x "$venv/bin/python" ] || "$python" -m venv "$venv"
"$venv/bin/python" -m pip install --quiet --disable-pip-version-check uv
# Certificates that the machine trusts, as pip takes them; the second is the name that newer versions know.
export UV_NATIVE_TLS=1 UV_SYSTEM_CERTS=1
"$venv/bin/python" -m uv pip install --quiet --python "$venv/bin/python" --resolution lowest-direct -e '.[test]'
"$venv/bin/python" -m uv pip freeze --python "$venv/bin/python" | grep -E '^(numpy|scipy|pandas|xarray|scikit-fem|pyvista)=='
# shellcheck disable=SC2086
"$venv/bin/python" -m pytest -q -p no:cacheprovider $sample
