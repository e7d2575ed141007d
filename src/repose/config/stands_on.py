"""Settings of the configuration that each stage reads, on which its results depend.

The workflow and the record of provenance take them from here.
"""

import functools
from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from typing import Any

from repose.bench import bench, bench_tests
from repose.calibrate.seeds import UNNAMED
from repose.calibrate.strategies import names, strategy
from repose.common import attached
from repose.common.keys import Config
from repose.common.provenance import engine_hash, hash_of, hash_of_file
from repose.config.models import named_files, valid_sections
from repose.config.results_folder import run_folder

# Entries that are no keys: what `responses` gives, the hash of `scene`, the keys by which any bench test is measured.
RESPONSES, SCENE, MEASURED_BY = "responses", "scene", "measured_by"
# Each rule says these again; tests compare them with the rules, and with the keys that the stages read.
KEYS = {
    "berry": ("berry",), "shape": ("berry",), "design": ("parameters", "design"), "dataset": (RESPONSES,),
    "network": (RESPONSES, "surrogate", "network"), "miga": ("parameters", "targets", "miga"),
    "solutions": ("parameters", "targets", "validation.solutions"),
    "published_solutions": ("parameters", "validation.published"),
    "published_sets": (RESPONSES, "parameters", "validation.published", SCENE),
    "validate": ("parameters", "targets", "measure", "validation.published_simulated", SCENE),
    "silhouette": ("measure",), "measure_silhouette": ("measure",),
    "drum_tables": ("measure.mm_per_pixel", "drum"), "noise": ("targets",),
    "posterior": ("parameters", "targets", "posterior"), "sensitivity": ("parameters", "targets", "sensitivity"),
    "plausible": ("posterior.seed",),
    "next": ("targets", "posterior.discrepancy_percent", "measure", MEASURED_BY),
    "conclude": ("parameters", "targets", "measure"),
}  # fmt: skip
# Names of the study and its folder, and the files of figures: no result depends on them.
NAMES = ("label", "results_dir", "figures")


def sections(config: Config, *names: str) -> dict[str, Any]:
    """Select sections of a configuration by name, single dotted keys (`design.seed`), or entries that are no keys."""
    keys = (name for name in names if name not in (RESPONSES, SCENE, MEASURED_BY))
    chosen = {
        name: _in_order(
            functools.reduce(lambda part, key: part[key], name.split("."), config)
        )
        for name in keys
    }
    chosen |= responses(config) if RESPONSES in names else {}
    chosen |= {SCENE: scene(config)} if SCENE in names else {}
    if MEASURED_BY in names:
        tests = (test for test in bench_tests() if config.get(test.name))
        chosen |= sections(
            config,
            *(f"{test.name}.{key}" for test in tests for key in test.measured_by),
        )
    return chosen


def reads(config: Config, *names: str) -> dict[str, Any]:
    """Select what a stage reads, as `sections`, with the content of files in place of their paths."""
    return _with_contents(sections(config, *names))


def _in_order(value: Any) -> Any:
    """Sort the keys of all mappings: snakemake compares texts, and files give any order."""
    return (
        {key: _in_order(value[key]) for key in sorted(value)}
        if isinstance(value, dict)
        else value
    )


def pouring(config: Config, apparatus: str = UNNAMED) -> dict[str, Any]:
    """Select the settings that a run of a bench test reads, without its measurement and the number of its seeds."""
    others = ("seeds", *bench(apparatus).measured_by)
    own = {
        key: value
        for key, value in sections(config, apparatus)[apparatus].items()
        if key not in others
    }
    return sections(config, "wall", "simulation", "design.seed") | {apparatus: own}


def measuring(config: Config, apparatus: str = UNNAMED) -> dict[str, Any]:
    """Select the settings that the measurement of a run reads."""
    test = bench(apparatus)
    own = (f"{apparatus}.{key}" for key in test.measured_by)
    return sections(config, "measure", *own) | responses(config, test.name)


def scene(config: Config) -> str:
    """Hash what a measured run depends on besides the engine: grain, bench tests of the targets, measurement.

    `measure.response` is none of it: every definition is measured, whichever is calibrated.
    """
    chosen = sections(config, "berry", "measure")
    chosen["measure"] = {
        key: value for key, value in chosen["measure"].items() if key != "response"
    }
    for name in dict.fromkeys(
        target.apparatus for target in valid_sections(config).targets
    ):
        measured_by = (f"{name}.{key}" for key in bench(name).measured_by)
        chosen |= pouring(config, name) | sections(config, *measured_by)
    return hash_of(_with_contents(chosen))


def responses(config: Config, apparatus: str | None = None) -> dict[str, Any]:
    """List the targets' names, of one bench test or of all, with the abscissae and functions of profiles."""
    own = [
        target
        for target in valid_sections(config).targets
        if apparatus in (None, target.apparatus)
    ]
    profiles = {
        target.profile.name: target.profile.abscissae
        for target in own
        if target.profile is not None
    }
    return {"responses": [target.response for target in own]} | (
        {"profiles": profiles} if profiles else {}
    )


def settings_of(
    config: Config,
    verb: str,
    apparatus: str | None = None,
    berry_is_made: bool = False,
    name: str | None = None,
) -> dict[str, Any]:
    """Select the settings that the stage of a verb reads, with the content of files in place of their paths.

    With `berry_is_made` the stage makes grain and particle itself; `name` is the strategy that proposes. A verb or a
    strategy that does not list its keys reads the whole configuration except its names.
    """
    keys = KEYS.get(verb) if name is None or verb in KEYS else strategy(name).reads
    apparatus = apparatus or UNNAMED
    if verb == "pour":
        chosen = pouring(config, apparatus)
    elif verb == "heap":
        chosen = pouring(config) | measuring(config)
    elif verb == "drum":
        chosen = pouring(config, "drum")
    elif verb == "measure_runs":
        chosen = measuring(config, apparatus)
    elif keys is not None:
        chosen = sections(config, *keys)
    else:
        chosen = {name: value for name, value in config.items() if name not in NAMES}
    if berry_is_made:
        chosen |= sections(config, *KEYS["shape"])
    return _with_contents(chosen)


def outdated(config: Config, paths: Iterable[str | PathLike]) -> list[str]:
    """Find results of other settings or another engine, among paths that exist and carry a record."""
    results = []
    for path in paths:
        record = attached.read(path)
        if (
            record is None or record.get("seed") is None
        ):  # of a stage that reads no configuration
            continue
        apparatus, name = record.get("apparatus"), record.get("strategy")
        is_known = apparatus in (None, *config) and name in (None, *names())
        if not is_known or (
            record["verb"] == "propose" and name is None
        ):  # of a version that did not note it
            continue
        # a stage by hand may have made the grain itself
        given = [
            settings_of(config, record["verb"], apparatus, made, name)
            for made in (False, True)
        ]
        if record["settings"] not in map(hash_of, given) or record["engine"] not in (
            None,
            engine_hash(),
        ):
            results.append(str(path))
    return results


def own_dataset(config: Config) -> Path | None:
    """Return dataset.csv of the study if it, its piles and its grain were made by these settings; else None."""
    results = Path(valid_sections(config).results_dir)
    piles, table = (
        list(results.glob(f"{run_folder(UNNAMED)}/*.json")),
        results / "dataset.csv",
    )
    files = [*results.glob("berry/*.json"), *piles, table]
    if not piles or None in map(attached.read, files) or outdated(config, files):
        return None
    return (
        table
        if table.stat().st_mtime >= max(path.stat().st_mtime for path in piles)
        else None
    )


def _with_contents(chosen: dict[str, Any]) -> dict[str, Any]:
    """Put hashes of contents in place of the paths of files."""
    chosen = dict(chosen)
    for name in named_files():
        section, _, key = name.rpartition(".")
        if chosen.get(name) is not None:
            chosen[name] = _content(chosen[name])
        if chosen.get(section, {}).get(key) is not None:
            chosen[section] = chosen[section] | {key: _content(chosen[section][key])}
    return chosen


def _content(path: str | PathLike) -> str | None:
    """Hash a file; None if missing: its reader reports it."""
    return hash_of_file(path) if Path(path).is_file() else None
