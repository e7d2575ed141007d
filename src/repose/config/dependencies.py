"""The settings that each stage of the workflow reads.

They are those that the stage itself reads, and those of the results that it reads. A
rule hands them to Snakemake as a parameter, so that their change runs the stage again.
The record of a result has them, so that a result of other settings is found.
"""

from collections.abc import Iterable, Mapping
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

from repose.bench import bench, bench_tests
from repose.calibrate.seeds import UNNAMED
from repose.calibrate.strategies import names, strategy
from repose.common import attached
from repose.common.errors import InputError
from repose.common.keys import Config
from repose.common.provenance import (
    Inputs,
    Record,
    as_recorded,
    engine_hash,
    hash_of,
    hash_of_file,
)
from repose.config.models import named_files, targets_of, valid_sections
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
# Stages whose results a stage reads, directly. `RUNS` are the runs of the targets.
RUNS = "runs"
READS: dict[str, tuple[str, ...]] = {
    "dataset": (RUNS,),
    "network": ("dataset",),
    "miga": ("network",),
    "solutions": ("miga",),
    "validate": ("solutions", RUNS),
    "drum_tables": ("drum",),
    "noise": ("dataset",),
    "posterior": ("miga",),
    "sensitivity": ("network",),
    "plausible": ("posterior",),
    "next": ("plausible",),
    "conclude": (RUNS,),
}
# Stages whose results are compared with a study. Rules choose the keys of pictures, and
# of the studies in `research`.
COMPARED = {*KEYS, "pour", "measure_runs", "heap", "drum", "propose", "material_card"}
# No result depends on the name of the study, its folder, or the format of its figures.
WITHOUT_EFFECT = ("label", "results_dir", "figures")


def settings_of(
    config: Config,
    stage: str,
    apparatus: str | None = None,
    name: str | None = None,
) -> dict[str, Any]:
    """Select the settings that a stage, and the results that it reads, depend on.

    Parameters
    ----------
    config : mapping
        A resolved configuration.
    stage : str
        Name of the stage.
    apparatus : str, optional
        Bench test of a stage that simulates or measures; by default the funnel.
    name : str, optional
        Strategy of the stages `propose` and `conclude`.

    Returns
    -------
    dict
        Values by section or dotted key. A hash of its content stands in place of the
        path of a file.
    """
    return _with_contents(_selected(config, stage, apparatus or UNNAMED, name))


def _selected(
    config: Config, stage: str, test: str, name: str | None
) -> dict[str, Any]:
    """Select the settings of a stage, with the paths of files."""
    grain = sections(config, *KEYS["shape"])
    if stage == "pour":
        return grain | simulation_settings(config, test)
    if stage == "drum":
        return grain | simulation_settings(config, "drum")
    if stage in ("measure_runs", "heap"):
        return (
            grain
            | simulation_settings(config, test)
            | measurement_settings(config, test)
        )
    if stage == RUNS:
        return grain | _of_runs(config)

    keys = KEYS.get(stage)
    if name is not None:
        of_strategy = strategy(name).reads
        keys = None if of_strategy is None else (*(keys or ()), *of_strategy)
    if keys is None:
        return {
            key: value for key, value in config.items() if key not in WITHOUT_EFFECT
        }
    selected: dict[str, Any] = {}
    for earlier in READS.get(stage, ()):
        selected |= _selected(config, earlier, test, None)
    return selected | sections(config, *keys)


def _of_runs(config: Config) -> dict[str, Any]:
    """Select the settings of the measured runs of all targets, and their parameters."""
    selected = sections(config, "parameters")
    targets = valid_sections(config).targets
    for test in dict.fromkeys(target.apparatus for target in targets):
        selected |= simulation_settings(config, test) | measurement_settings(
            config, test
        )
    return selected | responses(config)


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


def simulation_settings(config: Config, apparatus: str = UNNAMED) -> dict[str, Any]:
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


def measurement_settings(config: Config, apparatus: str = UNNAMED) -> dict[str, Any]:
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
        selected |= simulation_settings(config, test)
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


class Difference(NamedTuple):
    """A setting of a result that the study has otherwise."""

    key: str
    then: Any
    now: Any


def difference(
    config: Config, record: Record | None, is_of_engine: bool = True
) -> Difference | None:
    """Find a setting in which a result differs from the study.

    Parameters
    ----------
    config : mapping
        The resolved configuration of the study.
    record : mapping or None
        The record of the result; without one there is nothing to compare.
    is_of_engine : bool
        Whether the engine is compared, too.

    Returns
    -------
    Difference or None
        The first difference, in the order of the keys; None if there is none.
    """
    if record is None or record["verb"] not in COMPARED:
        return None
    then = record["settings"]
    apparatus = record.get("apparatus")
    name = record.get("strategy")
    is_known = apparatus in (None, *config) and name in (None, *names())
    # Before version 0.5 a record had a hash of its settings.
    if not isinstance(then, Mapping) or not is_known:
        return None
    now = as_recorded(settings_of(config, record["verb"], apparatus, name))
    if then != now:
        return _first_difference(then, now)
    engine = engine_hash()
    if is_of_engine and record["engine"] not in (None, engine):
        return Difference("engine", record["engine"], engine)
    return None


def _first_difference(then: Any, now: Any, prefix: str = "") -> Difference:
    """Find the first key, and inside it the innermost, that two settings differ in."""
    if isinstance(then, Mapping) and isinstance(now, Mapping):
        # The hash of a scene says less than the keys that it is made of.
        for key in sorted({*then, *now}, key=lambda key: (key == SCENE, key)):
            if then.get(key) != now.get(key):
                return _first_difference(then.get(key), now.get(key), f"{prefix}.{key}")
    if isinstance(then, list) and isinstance(now, list) and len(then) == len(now):
        for k, (one, other) in enumerate(zip(then, now, strict=True)):
            if one != other and isinstance(one, Mapping):
                return _first_difference(one, other, f"{prefix}.{k}")
    return Difference(prefix.removeprefix("."), then, now)


def require_same_study(config: Config, inputs: Inputs, source: str) -> None:
    """Raise InputError if an input of a stage is a result of other settings.

    Parameters
    ----------
    config : mapping
        The resolved configuration of the stage.
    inputs : iterable of (Path, mapping or None)
        Files with their records.
    source : str
        The file of the configuration, for the message.
    """
    for path, record in inputs:
        found = difference(config, record, is_of_engine=False)
        if found is not None:
            raise InputError(
                path,
                found.key,
                found.then,
                f"{found.now}, as in {source}: results of one study; give the "
                "configuration of this file, or make the file again with this one",
            )


def find_outdated(config: Config, paths: Iterable[str | PathLike]) -> list[str]:
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
    return [str(path) for path in paths if difference(config, attached.read(path))]


def find_own_dataset(config: Config) -> Path | None:
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
    if any(attached.read(path) is None for path in files) or find_outdated(
        config, files
    ):
        return None
    newest_pile = max(path.stat().st_mtime for path in piles)
    return table if table.stat().st_mtime >= newest_pile else None
