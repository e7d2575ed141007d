"""Verbs around a study: the verification suite, the speed, and provenance."""

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING

from repose.cli.options import JSON, require_option
from repose.cli.registry import Option, verb
from repose.common.errors import InputError
from repose.config.pipeline import PipelineConfig
from repose.stages import published

if TYPE_CHECKING:
    from repose.verification.case import Row


@verb(JSON)
def bench(args: argparse.Namespace, study: PipelineConfig) -> None:
    """Measure the speed: microseconds per step and seconds per pour, with a reference for the speed of the machine.

    example: --json
    """
    from repose.verification import speed

    of_published = published.representative(
        study.settings.validation.published, study.parameters.names
    )
    result = speed.run(
        study.config,
        {study.settings.berry.particle: study.particle},
        study.grain,
        of_published,
    )
    print(json.dumps(result, indent=1) if args.json else speed.message(result))


@verb(
    Option(
        "--case",
        action="append",
        metavar="NAME",
        help="run this case; may be given several times",
    ),
    Option(
        "--hits",
        type=int,
        default=10_000,
        help="impacts of each kind in the energy cases (10000)",
    ),
    out="results/verification",
)
def verify(args: argparse.Namespace, study: PipelineConfig) -> int:
    """Run the simulator's verification suite: compare its results with known answers.

    example: --out results/verification --case chung1
    """
    require_option(args.hits >= 1, "--hits", args.hits, "at least 1")

    from repose import verification

    laws = study.settings.simulation.laws
    print("laws: " + ", ".join(laws.values()), flush=True)
    effort = verification.Effort(hits=args.hits, laws=laws)
    results = verification.run(
        args.case, effort, lambda name, rows: print(_case_line(name, rows), flush=True)
    )
    table = Path(args.out) / "verification.csv"
    verification.write(results, table)
    print(table)
    return 0 if all(row.passed for rows in results.values() for row in rows) else 1


def _case_line(name: str, rows: "list[Row]") -> str:
    """Write a case as a line of text."""
    missed = [row for row in rows if not row.passed]
    words = (
        f"{len(missed)} of {len(rows)} numbers miss"
        if missed
        else f"{len(rows)} numbers, good"
    )
    return f"{name:>12}: {words}" + "".join(
        f"; {row.quantity} is {row.result:.6g}" for row in missed[:3]
    )


@verb(Option("result", help="a file that a verb wrote"), JSON, config=False)
def provenance(args: argparse.Namespace) -> None:
    """Print the provenance of a result: stage, settings, engine, origin, seed, versions and processor.

    example: results/dataset.csv
    """
    from repose.common import attached

    if not Path(args.result).is_file():
        raise FileNotFoundError(f"{args.result}: no such file")
    record = attached.read(args.result)
    if record is None:
        raise InputError(
            args.result, "provenance", None, "a result that a verb of repose wrote"
        )
    width = max(map(len, record))
    lines = (f"{key:<{width}}  {value}" for key, value in record.items())
    print(json.dumps(record, indent=1) if args.json else "\n".join(lines))
