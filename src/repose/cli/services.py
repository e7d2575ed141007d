"""Subcommands for the speed of the simulator and the provenance of a result."""

import argparse
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from repose.cli.options import JSON
from repose.cli.registry import Option, subcommand
from repose.common.errors import InputError
from repose.config.pipeline import PipelineConfig
from repose.stages import published


@subcommand(JSON)
def bench(args: argparse.Namespace, study: PipelineConfig) -> None:
    """Measure the speed of the simulator with the grain of a study.

    The result is in microseconds per step and seconds per pour. A reference calculation
    gives the speed of the machine.

    Examples
    --------
    $ repose bench --json
    """
    from repose.bench import speed

    # Simulate the grain of the study. The contact parameters are those of the published
    # answer, so that measurements of different studies can be compared.
    settings = study.settings
    parameters = published.read_representative(
        settings.validation.published, study.parameters.names
    )
    # The simulated grain by the name of its kind of shape, such as ellipsoid.
    particles = {settings.berry.particle: study.particle}
    result = speed.run(
        study.config, particles, berry=study.grain, parameters=parameters
    )
    if args.json:
        print(json.dumps(result, indent=1))
    else:
        print(speed.format_result(result))


@subcommand(Option("result", help="a file that a subcommand wrote"), JSON, config=False)
def provenance(args: argparse.Namespace) -> None:
    """Print the provenance of a result.

    It states from what a result was made: the stage, settings, engine, origin, seed,
    versions and processor.

    Examples
    --------
    $ repose provenance results/dataset.csv
    """
    from repose.common import attached

    # A missing file is a fault of the command line. A file without a record is itself
    # the source of the fault.
    if not Path(args.result).is_file():
        raise InputError(
            "command line",
            key="provenance",
            value=args.result,
            allowed="a file that a subcommand of repose wrote",
        )
    record = attached.read_record(args.result)
    if record is None:
        raise InputError(
            args.result,
            key="provenance",
            value=None,
            allowed="a result that a subcommand of repose wrote",
        )

    # Print the record as JSON, or its values in a column.
    if args.json:
        print(json.dumps(record, indent=1))
        return
    values = _flatten(record)
    width = max(len(key) for key in values)
    for key, value in values.items():
        print(f"{key:<{width}}  {value}")


def _flatten(section: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Convert nested mappings to one mapping with dotted keys.

    Parameters
    ----------
    section : mapping
        Values by key, which may be mappings.
    prefix : str, optional
        Dotted key of the section, with a trailing dot; empty for the outermost one.

    Returns
    -------
    dict
        The values by their dotted keys.
    """
    values: dict[str, Any] = {}
    for key, value in section.items():
        if isinstance(value, dict):
            values |= _flatten(value, f"{prefix}{key}.")
        else:
            values[f"{prefix}{key}"] = value
    return values
