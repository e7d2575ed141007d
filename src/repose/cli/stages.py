"""A verb as a stage: the files of its options, and the settings that it reads."""

import argparse
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

from repose.cli.registry import VERBS
from repose.core import places, provenance
from repose.core.lock import joined_folder


@contextmanager
def stage(args: argparse.Namespace, runs: Literal["", "made", "measured"] = "") -> Iterator[None]:
    """Run a verb as a stage; where its configuration lies in a folder of results, hold the folder meanwhile."""
    strategy = getattr(args, "strategy", None)

    def settings_of(config: Mapping[str, Any], apparatus: str | None) -> Any:
        from repose.config import stands_on

        berry_is_made = hasattr(args, "particle") and args.particle is None
        return stands_on.settings_of(config, args.verb, apparatus, berry_is_made, strategy)

    folder = Path(getattr(args, "config", None) or "").parent
    apparatus = getattr(args, "apparatus", None)
    stage_of = provenance.stage(args.verb, files_of(args), settings_of, apparatus, runs, strategy)
    with joined_folder(folder), stage_of:
        yield
    if getattr(args, "config", None) is not None:
        note_built_in_crop(args.config)


def note_built_in_crop(*files: str) -> None:
    """Print on stderr if the built-in crop stands in for a configuration that the folder lacks."""
    from repose.config import loader

    own = loader.own_crop_under(*files)
    if own is not None and not any("simulator" in loader.read(places.find(path)) for path in files):
        print(
            f"repose: note: this folder has no config.yaml; missing settings were taken from "
            f"the built-in goji example, {own}",
            file=sys.stderr,
        )


def files_of(args: argparse.Namespace) -> Iterator[Path]:
    """Files that the recorded options of a verb name; of a folder its dataset, if it has one."""
    for option in (option.attribute for option in VERBS[args.verb].options if option.recorded):
        value = getattr(args, option)
        if (args.verb, option) == ("dataset", "jobs"):  # a folder of them may be given
            from repose.chain.dataset import job_files

            value = list(map(str, job_files(value, args.samples)))
        for item in value if isinstance(value, list) else [value]:
            if isinstance(item, str):
                path = Path(item.partition("=")[2] if option == "input" else item)
                path = path / "dataset.csv" if path.is_dir() else path
                if path.is_file():
                    yield path
