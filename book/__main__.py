"""``python -m book``: build the verification and validation book."""

import argparse
import os
import sys
from pathlib import Path

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")


def main(arguments: list[str] | None = None) -> int:
    """Command line."""
    from book.build import build
    from book.work import Desk
    from spindle_fem.errors import SpindleFemError

    parser = argparse.ArgumentParser(prog="python -m book", description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=Path("reports/book"))
    parser.add_argument("--work", type=Path, default=Path("runs/book"), help="data that chapters make")
    parser.add_argument("--study", type=Path, default=Path("runs/study"), help="concealed study")
    parser.add_argument("--results", type=Path, default=None, help="default: STUDY/results")
    parser.add_argument("--recordings", type=Path, default=Path("../shared/recordings"))
    parser.add_argument(
        "--earlier",
        type=Path,
        action="append",
        default=[],
        help="earlier study to show beside; may be repeated",
    )
    parser.add_argument("--only", action="append", default=[], help="only this chapter; may be repeated")
    parser.add_argument("--keep", action="store_true", help="use data of an earlier version of the source")
    given = parser.parse_args(arguments)
    desk = Desk(
        given.work,
        given.study,
        given.results or given.study / "results",
        given.recordings,
        keep=given.keep,
        tell=lambda text: print(text, flush=True),
        earlier=tuple(given.earlier),
    )
    try:
        build(given.output, desk, given.only)
    except SpindleFemError as error:
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        return 2
    print(given.output / "index.html")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
