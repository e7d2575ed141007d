"""The settings that each stage of the workflow reads.

A rule hands them to Snakemake as a parameter, so that their change runs the stage again.
The record of a result has their hash, so that a result of other settings is found.
"""

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
from repose.config.models import named_files, targets_of
from repose.config.results_folder import run_folder

# Entries that are no keys of a configuration:
RESPONSES = "responses"  # names and definitions of the targets, without their values
SCENE = "scene"  # hash of what a measured run depends on
MEASURED_BY = "measured_by"  # keys by which any bench test is measured

# Sections and dotted keys that each stage reads. A stage that is not here reads the
# settings of a bench test, or all settings. A test compares them with the code.
KEYS: dict[str, tuple[str, ...]] = {
    "berry": ("berry",),
    "shape": ("berry",),
    "design": ("parameters", "design"),
    "dataset": (RESPONSES,),
    "network": (RESPONSES, "surrogate", "network"),
    "miga": ("parameters", "targets", "miga"),
    "optimism": ("parameters", "targets", "miga", "validation.solutions"),
    "solutions": ("parameters", "targets", "validation.solutions"),
    "published_solutions": ("parameters", "validation.published"),
    "published_sets": (RESPONSES, "parameters", "validation.published", SCENE),
    "validate": (
        "parameters",
        "targets",
        "measure",
        "validation.published_simulated",
        SCENE,
    ),
    "silhouette": ("measure",),
    "measure_silhouette": ("measure",),
    "drum_tables": ("measure.mm_per_pixel", "drum"),
    "noise": ("targets",),
    "posterior": ("parameters", "targets", "posterior"),
    "sensitivity": ("parameters", "targets", "sensitivity"),
    "plausible": ("posterior.seed",),
    "next": (
        "targets",
        "posterior.discrepancy_percent",
        "measure",
        MEASURED_BY,
    ),
    "conclude": ("parameters", "targets", "measure"),
}
# No result depends on the name of the study, its folder, or the format of its figures.
WITHOUT_EFFECT = ("label", "results_dir", "figures")


def settings_of(
    config: Config,
    stage: str,
    apparatus: str | None = None,
    makes_grain: bool = False,
    name: str | None = None,
) -> dict[str, Any]:
    """Select the settings that a stage reads.

    Parameters
    ----------
    config : mapping
        A resolved configuration.
    stage : str
        Name of the stage.
    apparatus : str, optional
        Bench test of a stage that simulates or measures; by default the funnel.
    makes_grain : bool, optional
        Whether the stage makes grain and particle itself.
    name : str, optional
        Strategy of the stage `propose`.

    Returns
    -------
    dict
        Values by section or dotted key. A hash of its content stands in place of the
        path of a file.
    """
    test = apparatus or UNNAMED
    if stage == "pour":
        selected = simulating(config, test)
    elif stage == "drum":
        selected = simulating(config, "drum")
    elif stage == "measure_runs":
        selected = measuring(config, test)
    elif stage == "heap":
        selected = simulating(config) | measuring(config)
    else:
        selected = _of_other_stage(config, stage, name)
    if makes_grain:
        selected |= sections(config, *KEYS["shape"])
    return _with_contents(selected)


def _of_other_stage(config: Config, stage: str, name: str | None) -> dict[str, Any]:
    """Select the settings of a stage that neither simulates nor measures."""
    if stage in KEYS:
        return sections(config, *KEYS[stage])
    keys = None if name is None else strategy(name).reads
    if keys is not None:
        return sections(config, *keys)
    return {key: value for key, value in config.items() if key not in WITHOUT_EFFECT}


def sections(config: Config, *keys: str) -> dict[str, Any]:
    """Select sections, single dotted keys, or the entries that are no keys.

    Parameters
    ----------
    config : mapping
        A resolved configuration.
    *keys : str
        Such as ``miga``, ``design.seed`` or `RESPONSES`.

    Returns
    -------
    dict
        Values by key; all mappings are sorted, since Snakemake compares texts.
    """
    selected: dict[str, Any] = {}
    for key in keys:
        if key == RESPONSES:
            selected |= responses(config)
        elif key == SCENE:
            selected[SCENE] = scene(config)
        elif key == MEASURED_BY:
            for test in bench_tests():
                if config.get(test.name):
                    selected |= _of_bench_test(config, test.name, test.measured_by)
        else:
            selected[key] = _sorted(_value_of(config, key))
    return selected


def _value_of(config: Config, key: str) -> Any:
    """Return the value of a dotted key."""
    value: Any = config
    for step in key.split("."):
        value = value[step]
    return value


def _sorted(value: Any) -> Any:
    """Sort the keys of all mappings in a value."""
    if not isinstance(value, dict):
        return value
    return {key: _sorted(value[key]) for key in sorted(value)}


def _of_bench_test(config: Config, test: str, keys: Iterable[str]) -> dict[str, Any]:
    """Select keys of the section of a bench test."""
    return sections(config, *(f"{test}.{key}" for key in keys))


def simulating(config: Config, apparatus: str = UNNAMED) -> dict[str, Any]:
    """Select the settings that one run of a bench test reads.

    Neither its measurement nor the number of its seeds is among them.
    """
    without = ("seeds", *bench(apparatus).measured_by)
    section = sections(config, apparatus)[apparatus]
    selected = sections(config, "wall", "simulation", "design.seed")
    selected[apparatus] = {
        key: value for key, value in section.items() if key not in without
    }
    return selected


def measuring(config: Config, apparatus: str = UNNAMED) -> dict[str, Any]:
    """Select the settings that the measurement of a run reads."""
    test = bench(apparatus)
    selected = sections(config, "measure")
    selected |= _of_bench_test(config, apparatus, test.measured_by)
    return selected | responses(config, test.name)


def scene(config: Config) -> str:
    """Hash what a measured run depends on besides the engine.

    This is the grain, the bench tests of the targets, and the measurement except for
    `measure.response`: every definition is measured, whichever is calibrated.
    """
    selected = sections(config, "berry", "measure")
    measure = dict(selected["measure"])
    measure.pop("response", None)
    selected["measure"] = measure
    targets = targets_of(config)
    for test in dict.fromkeys(target.apparatus for target in targets):
        selected |= simulating(config, test)
        selected |= _of_bench_test(config, test, bench(test).measured_by)
    return hash_of(_with_contents(selected))


def responses(config: Config, apparatus: str | None = None) -> dict[str, Any]:
    """List the targets' names, with the abscissae and functions of profiles.

    `apparatus` selects the targets of one bench test.
    """
    response_names = []
    profiles = {}
    for target in targets_of(config):
        if apparatus not in (None, target.apparatus):
            continue
        response_names.append(target.response)
        if target.profile is not None:
            profiles[target.profile.name] = target.profile.abscissae
    selected: dict[str, Any] = {"responses": response_names}
    if profiles:
        selected["profiles"] = profiles
    return selected


def _with_contents(selected: dict[str, Any]) -> dict[str, Any]:
    """Put hashes of contents in place of the paths of files."""
    selected = dict(selected)
    for name in named_files():
        if selected.get(name) is not None:
            selected[name] = _content_hash(selected[name])
        section, _, key = name.rpartition(".")
        if selected.get(section, {}).get(key) is not None:
            path = selected[section][key]
            selected[section] = selected[section] | {key: _content_hash(path)}
    return selected


def _content_hash(path: str | PathLike) -> str | None:
    """Hash a file; None if it is missing, which its reader reports."""
    return hash_of_file(path) if Path(path).is_file() else None


# --- results of other settings --------------------------------------------------------


def outdated(config: Config, paths: Iterable[str | PathLike]) -> list[str]:
    """Find results of other settings or of another engine.

    Parameters
    ----------
    config : mapping
        A resolved configuration.
    paths : iterable of path
        Files that exist. One without a record is left out.

    Returns
    -------
    list of str
        The paths of such results.
    """
    return [str(path) for path in paths if not _is_current(config, path)]


def _is_current(config: Config, path: str | PathLike) -> bool:
    """Tell whether a result is of this configuration and engine, as far as its record says."""
    record = attached.read(path)
    if record is None or record.get("seed") is None:
        return True  # of a stage that reads no configuration
    apparatus = record.get("apparatus")
    name = record.get("strategy")
    is_known = apparatus in (None, *config) and name in (None, *names())
    if not is_known or (record["verb"] == "propose" and name is None):
        return True  # of a version that recorded less
    if record["engine"] not in (None, engine_hash()):
        return False
    # A stage that somebody ran by hand may have made the grain itself.
    for makes_grain in (False, True):
        settings = settings_of(config, record["verb"], apparatus, makes_grain, name)
        if record["settings"] == hash_of(settings):
            return True
    return False


def own_dataset(config: Config) -> Path | None:
    """Find the study's own dataset.csv.

    Returns
    -------
    Path or None
        None unless the table, its piles and its grain were made by these settings, the
        table last.
    """
    folder = Path(config["results_dir"])
    table = folder / "dataset.csv"
    piles = list(folder.glob(f"{run_folder(UNNAMED)}/*.json"))
    if not piles:
        return None
    files = [*folder.glob("berry/*.json"), *piles, table]
    if any(attached.read(path) is None for path in files) or outdated(config, files):
        return None
    newest_pile = max(path.stat().st_mtime for path in piles)
    return table if table.stat().st_mtime >= newest_pile else None
