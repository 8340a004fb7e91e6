"""Every stage of the pipeline, and the same discrete problem in other programs, in one run.

    python benchmarks/stages.py [--sizes 68000 200000 800000] [--repeats 3] [--steps 100]
        [--python OTHER_INTERPRETER ...] [--programs NAME ...] [--no-pipeline] [-o runs/benchmark]

Programs that are not installed in any of the interpreters are left out by name.
Those that take part run in turn, each in a process of its own, and the minima
count; clocks start when a program has the mesh in its own form and end with
its temperatures. Writes ``benchmark.json``, ``table.md`` and ``cost.png``.
Numbers of different machines compare as ratios only: keep the machine quiet.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from case import loads_of, write_case
from comparison import OURS, PROGRAMS, compare, find_python, with_ratios

from spindle_fem.definition.load import load_machine
from spindle_fem.solvers.prepared_machine import prepare_machine

MACHINE = "wu_tan_2016"
SIZES = (68_000, 200_000, 800_000)
# Nodes of the divided mesh at size factors of the coarse preset (gmsh 4.15); between them a power law.
KNOWN = ((67_716, 1.3), (139_781, 0.68), (218_985, 0.54))
REDUCED_BELOW = 300_000
HEADS = (
    "program",
    "assembly s",
    "set-up s",
    "solve s",
    "steady s",
    "ratio",
    "steps s",
    "ratio",
    "ratios of processor time",
    "iterations",
    "kB a node",
    "largest difference K",
)
ROOT = Path(__file__).resolve().parents[1]


def size_factor_for(nodes: int) -> float:
    """Size factor that gives about so many nodes."""
    closest = min(KNOWN, key=lambda pair: abs(pair[0] - nodes))
    return round(closest[1] * (closest[0] / nodes) ** (1.0 / 2.4), 3)


def prepare_cases(sizes: list[int], folder: Path) -> dict[int, Path]:
    """Case folders by size; made where they are not there yet."""
    cases = {size: folder / f"case_{size}" for size in sizes}
    missing = {size: case for size, case in cases.items() if not (case / "case.json").exists()}
    if missing:
        loads = loads_of(prepare_machine(load_machine(MACHINE, ("mesh.preset=coarse",))))
        for size, case in missing.items():
            factor = size_factor_for(size)
            print(f"mesh for about {size} nodes, size factor {factor}", file=sys.stderr, flush=True)
            spec = load_machine(MACHINE, ("mesh.preset=coarse", "mesh.order=1"))
            write_case(case, prepare_machine(spec, size_factor=factor), loads)
    return cases


def call(script: str, *arguments: str, threads: int = 2) -> dict:
    """A benchmark in a process of its own; its JSON, or ``error``."""
    environment = {
        **os.environ,
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "SPINDLE_FEM_THREADS": str(threads),
        "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")]),
    }
    command = [sys.executable, str(ROOT / "benchmarks" / script), *arguments]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        return {"error": done.stderr.strip().splitlines()[-1][:200]}
    return json.loads(done.stdout.splitlines()[-1])


def main() -> None:
    """Run, write and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", type=int, nargs="+", default=list(SIZES))
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--steps", type=int, default=100)
    parser.add_argument("--python", nargs="*", default=[], help="Interpreters that have other programs.")
    parser.add_argument("--programs", nargs="*", help="Parts of names; all that are installed when absent.")
    parser.add_argument("--no-pipeline", action="store_true")
    parser.add_argument("-o", "--output", type=Path, default=Path("runs/benchmark"))
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    interpreters = [sys.executable, *arguments.python, "/usr/bin/python3"]
    found = [(program, find_python(program, interpreters)) for program in PROGRAMS]
    if arguments.programs is not None:
        found = [
            pair for pair in found if any(part.lower() in pair[0].name.lower() for part in arguments.programs)
        ]
    answer = {
        "machine": {"processor": platform.processor() or platform.machine(), "cores": os.cpu_count()},
        "left_out": [program.name for program, python in found if python is None],
        "rows": [],
        "roofline": [],
        "pipeline": [],
    }
    chosen = [(program, python) for program, python in found if python is not None]
    for size, case in prepare_cases(arguments.sizes, arguments.output).items():
        nodes = json.loads((case / "case.json").read_text(encoding="utf-8"))["nodes"]
        if chosen:
            answer["rows"] += with_ratios(compare(case, nodes, arguments.steps, arguments.repeats, chosen))
        answer["roofline"].append(call("roofline.py", str(case)))
        if not arguments.no_pipeline:
            options = ["--steps", str(arguments.steps)] + ["--no-reduced"] * (size > REDUCED_BELOW)
            stages = call("own_stages.py", str(size_factor_for(size)), "--machine", MACHINE, *options)
            answer["pipeline"].append(stages)
        text = json.dumps(answer, indent=1)
        (arguments.output / "benchmark.json").write_text(text, encoding="utf-8")
        (arguments.output / "table.md").write_text(tables(answer), encoding="utf-8")
    if answer["rows"]:
        draw(answer["rows"], arguments.output / "cost.png")
    print(tables(answer))


def tables(answer: dict) -> str:
    """Comparison, roofline and stages as Markdown."""
    lines = []
    for nodes in sorted({row["nodes"] for row in answer["rows"]}):
        lines += [
            f"\n### {nodes} nodes, linear\n",
            f"| {' | '.join(HEADS)} |",
            "|---" * len(HEADS) + "|",
        ]
        lines += [_line(row) for row in answer["rows"] if row["nodes"] == nodes]
    for item in answer["roofline"]:
        if "error" in item:
            lines.append(f"\nRoofline: {item['error']}")
            continue
        same = (row for row in answer["rows"] if row["nodes"] == item["nodes"])
        ours = next((row for row in same if row["program"] == OURS and "seconds" in row), None)
        product = min(value for key, value in item["product_s"].items() if "single" not in key)
        text = (
            f"\n{item['nodes']} nodes: one product reads {item['product_bytes'] / 1e6:.1f} MB, "
            f"{1e3 * item['product_at_stream_s']:.2f} ms at stream bandwidth "
            f"({max(item['stream_GB_s'].values()):.1f} GB/s); measured "
            + ", ".join(f"{name} {1e3 * value:.2f} ms" for name, value in item["product_s"].items())
        )
        if ours:
            text += f". The solve takes {ours['seconds']['solve'] / product:.0f} products."
        lines.append(text)
    stages = [item for item in answer["pipeline"] if "error" not in item]
    if stages:
        names = list(dict.fromkeys(name for item in stages for name in item["seconds"]))
        lines += [
            "\n### The machine's own pipeline, quadratic, seconds\n",
            "| stage | " + " | ".join(f"{item['nodes']} nodes" for item in stages) + " |",
            "|---" * (len(stages) + 1) + "|",
        ]
        for name in names:
            cells = [f"{item['seconds'][name]:.2f}" if name in item["seconds"] else "" for item in stages]
            lines.append(f"| {name} | " + " | ".join(cells) + " |")
        lines.append("| peak MB | " + " | ".join(f"{item['peak_MB']:.0f}" for item in stages) + " |")
    lines += [f"\nPipeline: {item['error']}" for item in answer["pipeline"] if "error" in item]
    if answer["left_out"]:
        lines.append(f"\nNot installed, left out: {'; '.join(answer['left_out'])}.")
    return "\n".join(lines) + "\n"


def _line(row: dict) -> str:
    if "error" in row:
        return f"| {row['program']} | {row['error']} |" + " |" * 10

    def number(value: float | None, form: str = ".3f") -> str:
        return "" if value is None else format(value, form)

    seconds = row["seconds"]
    worst = max(row["difference_K"].values(), default=0.0)
    return " | ".join(
        [
            f"| {row['program']}",
            number(seconds.get("assembly")),
            number(seconds.get("setup")),
            number(seconds.get("solve")),
            number(row["steady_s"]),
            number(row.get("steady_ratio"), ".2f"),
            number(row.get("steps_s")),
            number(row.get("steps_ratio"), ".2f"),
            " and ".join(
                number(row[key], ".2f")
                for key in ("steady_processor_ratio", "steps_processor_ratio")
                if key in row
            ),
            f"{row.get('iterations', '')}",
            number(row["peak_kB_a_node"], ".2f"),
            f"{worst:.1e}{'' if row['agrees'] else ' DOES NOT AGREE'} |",
        ]
    )


def draw(rows: list[dict], path: Path) -> None:
    """Microseconds a node against nodes, steady and steps."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(1, 2, figsize=(11.0, 4.6), sharex=True, layout="constrained")
    for axis, key, title in (
        (axes[0], "steady_s", "Assembly, set-up and solution"),
        (axes[1], "steps_s", "Implicit steps"),
    ):
        for name in dict.fromkeys(row["program"] for row in rows):
            own = [row for row in rows if row["program"] == name and key in row]
            if own:
                axis.loglog(
                    [row["nodes"] for row in own],
                    [1e6 * row[key] / row["nodes"] for row in own],
                    marker="o",
                    linewidth=2.2 if name == OURS else 1.0,
                    label=name,
                )
        axis.set(title=title, xlabel="nodes", ylabel="µs a node")
        axis.grid(True, which="both", alpha=0.3)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right", fontsize=8)
    figure.savefig(path, dpi=130)
    pyplot.close(figure)


if __name__ == "__main__":
    main()
