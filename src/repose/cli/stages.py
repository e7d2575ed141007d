"""A verb as a stage: the files of its options, and the settings that it reads."""

import argparse
import sys
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any, Literal

from repose.cli.registry import VERBS, configs_of
from repose.common import places, provenance
from repose.common.lock import joined_folder
from repose.stages.parameter_sets import job_files

# Options whose words may be folders, which stand for the files of this ending of all samples in them.
FOLDERS = {("dataset", "jobs"): ".json", ("measure_runs", "pours"): ".pours.json"}


@contextmanager
def stage(
    args: argparse.Namespace, runs: Literal["", "made", "measured"] = ""
) -> Iterator[None]:
    """Run a verb as a stage; where its configuration lies in a folder of results, hold the folder meanwhile."""
    files = configs_of(args)
    with joined_folder(Path(*files[-1:]).parent), recorded(args, runs):
        yield
    if files:
        note_built_in_crop(*files)


def recorded(
    args: argparse.Namespace, runs: Literal["", "made", "measured"] = ""
) -> AbstractContextManager[None]:
    """Record a verb with its options in every file that is written meanwhile."""
    strategy = getattr(args, "strategy", None)

    def settings_of(config: Mapping[str, Any], apparatus: str | None) -> Any:
        from repose.config import dependencies

        berry_is_made = hasattr(args, "particle") and args.particle is None
        return dependencies.settings_of(
            config, args.verb, apparatus, berry_is_made, strategy
        )

    return provenance.stage(
        args.verb,
        files_of(args),
        settings_of,
        getattr(args, "apparatus", None),
        runs,
        strategy,
    )


def note_built_in_crop(*files: str) -> None:
    """Print on stderr if the built-in crop stands in for a configuration that the folder lacks."""
    from repose.config import loader

    own = loader.own_crop_under(*files)
    if own is not None and not any(
        "simulator" in loader.read(places.find(path)) for path in files
    ):
        words = f"missing settings were taken from the built-in goji example, {own}"
        print(f"repose: note: this folder has no config.yaml; {words}", file=sys.stderr)


def files_of(args: argparse.Namespace) -> Iterator[Path]:
    """Yield the files that the recorded options of a verb name; of a folder its dataset, if it has one."""
    for option in (
        option.attribute for option in VERBS[args.verb].options if option.recorded
    ):
        value = getattr(args, option)
        if (args.verb, option) in FOLDERS:
            value = list(
                map(str, job_files(value, args.samples, FOLDERS[args.verb, option]))
            )
        for item in value if isinstance(value, list) else [value]:
            if isinstance(item, str):
                path = Path(item.partition("=")[2] if option == "input" else item)
                path = path / "dataset.csv" if path.is_dir() else path
                if path.is_file():
                    yield path
