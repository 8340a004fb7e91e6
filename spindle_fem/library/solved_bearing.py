"""``spindle_fem.bearing``: one bearing or preloaded set without a machine, to read and hand on."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tomli_w

from spindle_fem.physics.bearings.bearing_file import bearing_report
from spindle_fem.results.output_folder import replace_text
from spindle_fem.results.presented import Presented

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

ONE = "bearing"


class SolvedBearing(Presented, dict[str, Any]):
    """Content of ``spindle-fem bearing --json``, by key."""

    def to_pandas(self) -> pd.DataFrame:
        """Balls or rollers, by bearing and number: angles, loads, pressures, films; units in the names."""
        import pandas as pd

        alone = self["balls"] if "balls" in self else self.get("rollers")
        sets = {item["name"]: item["balls"] for item in self.get("bearings", ())} or {ONE: alone}
        tables = {name: pd.DataFrame(balls) for name, balls in sets.items()}
        return pd.concat(tables, names=["bearing", "ball"])

    def to_xarray(self) -> xr.Dataset:
        """The balls over ``bearing`` and ``ball``; units in the names."""
        return self.to_pandas().to_xarray()

    def save(self, file: str | Path) -> Path:
        """Write everything as JSON."""
        return replace_text(Path(file), json.dumps(self, indent=2, ensure_ascii=False) + "\n")

    def _headline(self) -> str:
        return ", ".join(f"{name} {text}" for name, text in self._rows().items())

    def _rows(self) -> Mapping[str, str]:
        found = {
            f"{direction} stiffness": f"{self[key]:.4g} N/µm"
            for direction in ("axial", "radial")
            if (key := f"{direction}_stiffness_N_um") in self
        }
        return found | ({} if self["heat_W"] is None else {"heat": f"{self['heat_W']:.4g} W"})


def bearing(case: str | Path | Mapping[str, Any]) -> SolvedBearing:
    """Solve one bearing or one preloaded set.

    Parameters
    ----------
    case : str, Path or mapping
        A file with ``[bearing]``, ``[operation]`` and perhaps ``[lubricant]``, or its tables.

    Raises
    ------
    BadInputError
        Every fault with file, key, value and what is allowed.
    NoEquilibriumError
        The state does not exist.
    """
    if isinstance(case, (str, Path)):
        return SolvedBearing(bearing_report(case))
    with tempfile.TemporaryDirectory(prefix="spindle-fem-") as folder:
        file = Path(folder) / "bearing.toml"
        file.write_text(tomli_w.dumps(case), encoding="utf-8")
        return SolvedBearing(bearing_report(file))
