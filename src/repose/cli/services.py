"""Verbs around a study: the speed, and provenance."""

import argparse
import json
from pathlib import Path

from repose.cli.options import JSON
from repose.cli.registry import Option, verb
from repose.common.errors import InputError
from repose.config.pipeline import PipelineConfig
from repose.stages import published


@verb(JSON)
def bench(args: argparse.Namespace, study: PipelineConfig) -> None:
    """Measure the speed: microseconds per step and seconds per pour, with a reference for the speed of the machine.

    example: --json
    """
    from repose.bench import speed

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
