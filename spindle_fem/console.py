"""Tables on the terminal, through rich."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table


def _table(title: str, *columns: str) -> Table:
    table = Table(title=title, title_justify="left", title_style="bold")
    table.add_column(columns[0])
    for column in columns[1:]:
        table.add_column(column, justify="right")
    return table


def _number(value: Any, digits: int) -> str:
    return "–" if value is None else f"{value:,.{digits}f}"


def print_run(summary: dict[str, Any], folder: Path) -> None:
    """Headline of a run: temperatures, bearings, balance, checks and warnings."""
    console = Console()
    table = _table("Bearings", "", "heat W", "inner °C", "outer °C", "balls °C", "difference K", "preload N", "lambda")
    for name, bearing in summary["bearings"].items():
        table.add_row(
            name,
            _number(bearing["heat_W"], 1),
            _number(bearing["temperature_inner_degC"], 2),
            _number(bearing["temperature_outer_degC"], 2),
            _number(bearing["temperature_ball_degC"], 2),
            _number(bearing["ring_difference_K"], 2),
            _number(bearing["preload_N"], 0),
            _number(bearing["lambda"], 1),
        )
    console.print(table)
    probes = _table("Probes", *(["", *summary["probes"]]))
    probes.add_row("°C", *(_number(value, 2) for value in summary["probes"].values()))
    console.print(probes)
    coolant = summary["coolant"]
    if coolant:
        film = coolant["film_coefficient_W_m2K"]
        console.print(
            f"Coolant {coolant['inlet_degC']:.2f} → {coolant['outlet_degC']:.2f} °C, {coolant['regime']}, "
            f"Re {coolant['reynolds']:.0f}, film {film['value']:.0f} ({film['low']:.0f}–{film['high']:.0f}) W/(m²·K), "
            f"pressure drop {coolant['pressure_drop_Pa'] / 1e5:.2f} bar"
        )
    temperature, energy, mesh = summary["temperature"], summary["energy"], summary["mesh"]
    console.print(f"Hottest {temperature['max_degC']:.2f} °C at {temperature['max_at_mm']} mm")
    console.print(
        f"Heat in {energy['heat_in_W']:.2f} W, imbalance {energy['imbalance_relative']:.1e}; "
        f"{mesh['nodes']:,} temperatures, {mesh['elements']:,} elements, worst quality {mesh['min_quality']:.2f}"
    )
    split = ", ".join(f"{name} {seconds:.1f}" for name, seconds in summary["timings_s"].items())
    console.print(f"{summary['wall_time_s']:.1f} s ({split}), peak {summary['peak_rss_MB']:.0f} MB")
    for check in summary["checks"]:
        if not check["passed"]:
            console.print(f"[bold red]FAILED[/] {check['name']}: {check['value']:.4g} {check['unit']}, "
                          f"limit {check['limit']:.4g}. {check['explanation']}")
    for warning in summary["warnings"]:
        console.print(f"[yellow]{warning['code']}[/]: {warning['text']}")
    console.print(f"Report: {folder / 'report.html'}")


def print_check(content: dict[str, Any]) -> None:
    """What a valid machine is made of."""
    console = Console()
    console.print(f"[bold]{content['machine']}[/] is valid.")
    for key in ("parts", "surfaces", "contacts", "probes"):
        table = _table(key, "name", "")
        for row in content[key]:
            table.add_row(row["name"], row.get("detail", ""))
        console.print(table)
    for warning in content["warnings"]:
        console.print(f"[yellow]{warning['code']}[/]: {warning['text']}")


def print_pairs(title: str, content: dict[str, Any]) -> None:
    """A title and one line for each key."""
    console = Console()
    console.print(title)
    for key, value in content.items():
        console.print(f"  {key}: {value}")


def print_heat(content: dict[str, Any]) -> None:
    """Heat term by term, one table a bearing, one row a speed."""
    console = Console()
    for name, rows in content["bearings"].items():
        terms = list(dict.fromkeys(term for row in rows for term in row["terms_W"]))
        table = _table(
            f"{name} ({content['model']})",
            "rpm", "heat W", *(f"{term} W" for term in terms), "axial load N", "α inner °", "α outer °", "film µm", "lambda",
        )
        for row in rows:
            table.add_row(
                f"{row['speed_rpm']:.0f}",
                _number(row["heat_W"], 1),
                *(_number(row["terms_W"].get(term), 1) for term in terms),
                _number(row["axial_load_N"], 0),
                _number(row["contact_angle_inner_deg"], 2),
                _number(row["contact_angle_outer_deg"], 2),
                _number(row["film_um"], 3),
                _number(row["lambda"], 1),
            )
        console.print(table)
    for warning in content["warnings"]:
        console.print(f"[yellow]{warning['code']}[/]: {warning['text']}")


def print_bearing(content: dict[str, Any]) -> None:
    """Deflections and a table of balls for one bearing or each of a set."""
    console = Console()
    for index, bearing in enumerate(content.get("bearings", [content])):
        scalars = {key: value for key, value in bearing.items() if not isinstance(value, (list, dict))}
        console.print(", ".join(f"{key} {value:.5g}" for key, value in scalars.items() if isinstance(value, float)))
        balls = bearing["balls"]
        keys = [key for key in balls[0] if any(ball[key] is not None for ball in balls)]
        table = _table(f"bearing {index + 1}", *keys)
        for ball in balls:
            table.add_row(*("–" if ball[key] is None else f"{ball[key]:.4g}" for key in keys))
        console.print(table)
