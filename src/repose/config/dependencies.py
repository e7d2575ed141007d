"""Select the settings on which each stage of the workflow depends.

A stage depends on the settings that it reads itself, and on the settings of the results
that it reads. A rule gives them to Snakemake as a parameter, so that the stage runs
again when they change. They are also written into the record of each result, so that a
result of other settings can be recognised.
"""

from collections.abc import Iterable, Mapping
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

from repose.bench import bench, bench_tests
from repose.calibrate import strategies
from repose.calibrate.seeds import UNNAMED
from repose.calibrate.targets import OWN_BENCH
from repose.common import attached
from repose.common.errors import InputError
from repose.common.keys import Config, get_value, lookup
from repose.common.provenance import (
    Inputs,
    Record,
    convert_to_recorded_form,
    engine_hash,
    hash_content,
    hash_file,
)
from repose.config.loader import is_external
from repose.config.models import list_file_keys, make_targets
from repose.config.results_folder import name_run_folder

# The following entries are not keys of a configuration, but are computed from it.
# Names and definitions of the targets, without their values.
RESPONSES = "responses"
# A hash of everything on which a measured run depends.
SCENE = "scene"
# The keys that determine how the runs of bench tests are measured.
MEASURED_BY = "measured_by"
# The part of the section of a user's own program on which its runs depend.
SIMULATOR = "simulator"

# Sections and dotted keys that each stage reads. A stage that is missing here reads the
# settings of a bench test, or may read any setting. A test compares this table with the
# keys that the code of the stages really reads.
STAGE_KEYS: dict[str, tuple[str, ...]] = {
    "berry": ("berry",),
    "shape": ("berry",),
    "design": ("parameters", "design"),
    "dataset": (RESPONSES,),
    "network": ("parameters", RESPONSES, "surrogate", "network"),
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
    "simulate": (SIMULATOR, "design.seed"),
}
# Stands for the runs of all bench tests of the targets.
RUNS_OF_TARGETS = "runs"
# Stages that simulate or measure with our simulator, and those that measure the runs of
# another program.
STAGES_OF_RUNS = ("pour", "measure_runs", "heap", "drum", RUNS_OF_TARGETS)
STAGES_OF_EXTERNAL_RUNS = ("measure_simulated", RUNS_OF_TARGETS)
# For each stage, the stages whose results it reads directly.
STAGE_SOURCES: dict[str, tuple[str, ...]] = {
    "dataset": (RUNS_OF_TARGETS,),
    "network": ("dataset",),
    "miga": ("network",),
    "solutions": ("miga",),
    "validate": ("solutions", RUNS_OF_TARGETS),
    "drum_tables": ("drum",),
    "noise": ("dataset",),
    "posterior": ("miga",),
    "sensitivity": ("network",),
    "plausible": ("posterior",),
    "next": ("plausible",),
    "conclude": (RUNS_OF_TARGETS,),
}
# Stages whose results are compared with the settings of a study. Other results, such as
# pictures, are left out, because their rules choose the settings themselves.
COMPARED_STAGES = {
    *STAGE_KEYS,
    "pour",
    "measure_runs",
    "measure_simulated",
    "heap",
    "drum",
    "propose",
    "material_card",
}
# Keys on which no result depends: the name of the study and the note on its data, its
# folder, and the format of its figures.
KEYS_WITHOUT_EFFECT = ("label", "note", "results_dir", "figures")
SIMULATOR_KEYS_WITHOUT_EFFECT = ("name", "memory_mb")


def select_stage_settings(
    config: Config,
    stage: str,
    apparatus: str | None = None,
    strategy_name: str | None = None,
) -> dict[str, Any]:
    """Select the settings that a stage, and the results that it reads, depend on.

    Parameters
    ----------
    config : mapping
        A resolved configuration.
    stage : str
        Name of the stage.
    apparatus : str, optional
        Bench test of a stage that simulates or measures. The default is the funnel.
        Other stages ignore it.
    strategy_name : str, optional
        Strategy of the stages `propose` and `conclude`; None for any other stage.

    Returns
    -------
    dict
        Values by section or dotted key. The path of a file is replaced by a hash of its
        content.
    """
    selected = _select_settings_with_paths(
        config, stage, apparatus or UNNAMED, strategy_name
    )
    return _hash_named_files(selected)


def _select_settings_with_paths(
    config: Config, stage: str, test: str, strategy_name: str | None
) -> dict[str, Any]:
    """Select the settings of a stage, and of the stages whose results it reads.

    Files appear as paths; `select_stage_settings` replaces them by hashes.

    Parameters
    ----------
    config : mapping
        A resolved configuration.
    stage : str
        Name of the stage, or `RUNS_OF_TARGETS` for the runs of the targets.
    test : str
        Bench test of a stage that simulates or measures. Other stages ignore it.
    strategy_name : str or None
        Strategy of the stages `propose` and `conclude`; None for any other stage.

    Returns
    -------
    dict
        Values by section or dotted key.
    """
    # A stage that simulates or measures depends on a bench test or on a program.
    if stage in STAGES_OF_EXTERNAL_RUNS and is_external(config):
        return _select_external_run_settings(config)
    if stage in STAGES_OF_RUNS:
        return _select_settings_of_run_stage(config, stage, test)

    # A stage that may read any key depends on all of them.
    keys = _find_keys_of_stage(stage, strategy_name)
    if keys is None:
        return _select_all_settings(config)

    # A stage also depends on the settings of the stages whose results it reads. These
    # stages do not depend on a strategy.
    selected: dict[str, Any] = {}
    for source_stage in STAGE_SOURCES.get(stage, ()):
        selected |= _select_settings_with_paths(
            config, source_stage, test, strategy_name=None
        )
    return selected | select_sections(config, *keys)


def _select_settings_of_run_stage(
    config: Config, stage: str, test: str
) -> dict[str, Any]:
    """Select the settings of a stage that simulates or measures with our simulator.

    Parameters
    ----------
    config : mapping
        A resolved configuration.
    stage : str
        One of `STAGES_OF_RUNS`.
    test : str
        Bench test of the runs. It is ignored for the runs of all targets, and for the
        stage `drum`, which has a bench test of its own.

    Returns
    -------
    dict
        Values by section or dotted key. Files appear as paths.
    """
    # Every run depends on the grain, whose settings are those of the stage `shape`.
    grain = select_sections(config, *STAGE_KEYS["shape"])
    if stage == RUNS_OF_TARGETS:
        return grain | _select_settings_of_all_targets(config)

    # These two stages only simulate. Another stage measures their runs.
    if stage == "pour":
        return grain | select_simulation_settings(config, test)
    if stage == "drum":
        return grain | select_simulation_settings(config, "drum")
    return grain | _select_settings_of_measured_run(config, test)


def _find_keys_of_stage(
    stage: str, strategy_name: str | None
) -> tuple[str, ...] | None:
    """Find the keys that a stage itself reads.

    Parameters
    ----------
    stage : str
        Name of the stage.
    strategy_name : str or None
        Strategy of the stages `propose` and `conclude`; None for any other stage.

    Returns
    -------
    tuple of str, or None
        Sections, dotted keys, and names of computed entries such as `RESPONSES`. None
        if the stage may read any key.
    """
    # A stage that `STAGE_KEYS` does not list may read any key.
    stage_keys = STAGE_KEYS.get(stage)
    if strategy_name is None:
        return stage_keys

    # A strategy need not declare which keys it reads. It may then read any key.
    strategy_keys = strategies.strategy(strategy_name).reads
    if strategy_keys is None:
        return None

    # A stage of a strategy, such as `propose`, may read only the keys of the strategy.
    return (*(stage_keys or ()), *strategy_keys)


def _select_all_settings(config: Config) -> dict[str, Any]:
    """Select all settings on which a result can depend."""
    return {
        key: value for key, value in config.items() if key not in KEYS_WITHOUT_EFFECT
    }


def _select_external_run_settings(config: Config) -> dict[str, Any]:
    """Select the settings of the measured runs of the user's own program."""
    return select_sections(
        config, *STAGE_KEYS["simulate"], "measure"
    ) | select_responses(config)


def _select_settings_of_all_targets(config: Config) -> dict[str, Any]:
    """Select the settings of the measured runs of all targets, and their parameters."""
    selected = select_sections(config, "parameters")
    # Several targets can share a bench test.
    tests = dict.fromkeys(target.apparatus for target in make_targets(config))
    for test in tests:
        selected |= _select_settings_of_measured_run(config, test)
    return selected | select_responses(config)


def _select_settings_of_measured_run(config: Config, test: str) -> dict[str, Any]:
    """Select the settings for a run of a bench test and for its measurement."""
    return select_simulation_settings(config, test) | select_measurement_settings(
        config, test
    )


def select_sections(config: Config, *keys: str) -> dict[str, Any]:
    """Select sections, single dotted keys, and computed entries such as `RESPONSES`.

    The result is a flat mapping. A new kind of computed entry needs a branch here.

    Parameters
    ----------
    config : mapping
        A resolved configuration.
    *keys : str
        Names such as ``miga``, ``design.seed`` or `RESPONSES`.

    Returns
    -------
    dict
        Values by key. All mappings are sorted, because Snakemake compares them as text.
    """
    selected: dict[str, Any] = {}
    for key in keys:
        # Computed entries come first. Two of them have several keys, which are merged
        # into the result.
        if key == RESPONSES:
            selected |= select_responses(config)
        elif key == SIMULATOR:
            selected[key] = _select_simulator_settings(config)
        elif key == SCENE:
            selected[SCENE] = hash_scene(config)
        elif key == MEASURED_BY:
            selected |= _select_measurement_keys(config)
        else:
            selected[key] = _sort_mappings(lookup(config, key))

        # The constraints are a key of their own, but belong to the parameters. A study
        # without constraints does not get this key, so that its settings stay the same.
        if key == "parameters" and config.get("constraints"):
            selected["constraints"] = list(config["constraints"])
    return selected


def _select_simulator_settings(config: Config) -> dict[str, Any]:
    """Select the settings on which the runs of a program depend.

    Hashes replace the files that the program reads. The name and the memory of the
    program are left out, because they change no result. If the time limit changes, runs
    that have ended by themselves are kept, and runs that it has stopped are repeated.
    """
    section = {
        key: value
        for key, value in config["simulator"].items()
        if key not in SIMULATOR_KEYS_WITHOUT_EFFECT
    }
    if "template" in section:
        section["template"] = _hash_content(section["template"])
    section["files"] = {
        Path(name).name: _hash_content(name) for name in section["files"]
    }
    return _sort_mappings(section)


def _select_measurement_keys(config: Config) -> dict[str, Any]:
    """Select the keys that determine how the runs of all bench tests are measured."""
    selected: dict[str, Any] = {}
    for test in bench_tests():
        if config.get(test.name):
            selected |= _select_test_keys(config, test.name, test.measured_by)
    return selected


def _sort_mappings(value: Any) -> Any:
    """Copy a value with the keys of all its mappings in alphabetical order."""
    if not isinstance(value, dict):
        return value
    return {key: _sort_mappings(value[key]) for key in sorted(value)}


def _select_test_keys(config: Config, test: str, keys: Iterable[str]) -> dict[str, Any]:
    """Select the values of a bench test's own keys, as a mapping from dotted keys."""
    return select_sections(config, *(f"{test}.{key}" for key in keys))


def select_simulation_settings(
    config: Config, apparatus: str = UNNAMED
) -> dict[str, Any]:
    """Select the settings that one run of a bench test reads.

    The number of seeds and the keys of the measurement are left out.
    """
    without_effect = ("seeds", *bench(apparatus).measured_by)
    section = select_sections(config, apparatus)[apparatus]
    selected = select_sections(config, "wall", "simulation", "design.seed")
    selected[apparatus] = {
        key: value for key, value in section.items() if key not in without_effect
    }
    return selected


def select_measurement_settings(
    config: Config, apparatus: str = UNNAMED
) -> dict[str, Any]:
    """Select the settings that the measurement of a run reads."""
    test = bench(apparatus)
    selected = select_sections(config, "measure")
    selected |= _select_test_keys(config, apparatus, test.measured_by)
    return selected | select_responses(config, test.name)


def hash_scene(config: Config) -> str:
    """Hash everything besides the engine that a measured run depends on.

    The hash covers the grain, the bench tests of the targets, and the section `measure`
    without its key `response`. The key `measure.response` chooses the definition of the
    angle that is calibrated. It does not change a measured run, because each run is
    measured by every definition.

    For a study with a user's own program, the hash covers the settings of this program
    instead.

    Parameters
    ----------
    config : mapping
        A resolved configuration.

    Returns
    -------
    str
        16 hexadecimal digits.
    """
    if is_external(config):
        return hash_content(_select_external_run_settings(config))

    # The section of the grain has the name `berry`. Leave out the choice of the
    # calibrated angle.
    selected = select_sections(config, "berry", "measure")
    measure = dict(selected["measure"])
    measure.pop("response", None)
    selected["measure"] = measure

    # Several targets can share a bench test.
    tests = dict.fromkeys(target.apparatus for target in make_targets(config))
    for test in tests:
        selected |= select_simulation_settings(config, test)
        selected |= _select_test_keys(config, test, bench(test).measured_by)
    return hash_content(_hash_named_files(selected))


def select_responses(config: Config, apparatus: str | None = None) -> dict[str, Any]:
    """Select which responses the targets have, and how these are defined.

    A response is a quantity that is measured on a run, such as an angle. The measured
    values of the targets are left out, because they do not change a run.

    Parameters
    ----------
    config : mapping
        A resolved configuration.
    apparatus : str, optional
        Select only the targets of this bench test. The default is all targets.

    Returns
    -------
    dict
        ``responses``: the names, in the order of the targets. ``profiles``: by the name
        of each profile, the positions at which it is compared. The key ``profiles`` is
        absent if no target has a profile.
    """
    response_names = []
    profiles = {}
    for target in make_targets(config):
        if apparatus is not None and target.apparatus != apparatus:
            continue
        response_names.append(target.response)
        if target.profile is not None:
            profiles[target.profile.name] = target.profile.abscissae
    selected: dict[str, Any] = {"responses": response_names}
    if profiles:
        selected["profiles"] = profiles
    return selected


def _hash_named_files(selected: dict[str, Any]) -> dict[str, Any]:
    """Copy settings, and replace each path of a file by a hash of the file's content.

    Parameters
    ----------
    selected : dict
        Values by section or dotted key. A path may be the value of a dotted key, or may
        lie inside a section.

    Returns
    -------
    dict
        The copy. The argument is not changed.
    """
    hashed = dict(selected)
    for dotted_key in list_file_keys():
        # The key of the file may have been selected on its own.
        if hashed.get(dotted_key) is not None:
            hashed[dotted_key] = _hash_content(hashed[dotted_key])
        # Otherwise the whole section around the key may have been selected. A key at
        # the top of the configuration has no section, so nothing is found for it.
        section_name, _, key = dotted_key.rpartition(".")
        section = hashed.get(section_name, {})
        if section.get(key) is not None:
            hashed[section_name] = section | {key: _hash_content(section[key])}
    return hashed


def _hash_content(path: str | PathLike) -> str | None:
    """Hash the content of a file; None for a missing file, which its reader reports."""
    return hash_file(path) if Path(path).is_file() else None


# --- results of other settings --------------------------------------------------------


class Difference(NamedTuple):
    """A setting in which a result differs from the study.

    Attributes
    ----------
    key : str
        Dotted key of the setting, or ``engine``.
    recorded : object
        The value in the record of the result.
    current : object
        The value in the study.
    """

    key: str
    recorded: Any
    current: Any


def find_difference(
    config: Config, record: Record | None, compare_engine: bool = True
) -> Difference | None:
    """Find the first setting in which a result differs from the study.

    Parameters
    ----------
    config : mapping
        The resolved configuration of the study.
    record : mapping or None
        The record of the result; None if the result has no record.
    compare_engine : bool
        Whether to compare the engine as well. The record has a hash of its code.

    Returns
    -------
    Difference or None
        The first difference, in the order of the keys. None if no difference is known,
        for example because the result cannot be compared.
    """
    if record is None or not _is_comparable(config, record):
        return None

    # Compare the settings. A record has the name of the stage under the key `verb`, and
    # that of the bench test under `apparatus`.
    recorded = record["settings"]
    current_settings = select_stage_settings(
        config,
        record["verb"],
        apparatus=record.get("apparatus"),
        strategy_name=record.get("strategy"),
    )
    current = convert_to_recorded_form(current_settings)
    if recorded != current:
        return _find_first_difference(recorded, current)

    # Compare the engine. If a result depends on no run, its record has no engine.
    recorded_engine = record["engine"]
    if compare_engine and recorded_engine not in (None, engine_hash()):
        return Difference("engine", recorded=recorded_engine, current=engine_hash())
    return None


def _is_comparable(config: Config, record: Record) -> bool:
    """Tell whether the settings of a result can be compared with those of a study.

    Parameters
    ----------
    config : mapping
        The resolved configuration of the study.
    record : mapping
        The record of the result. Its key `verb` has the name of the stage, and its key
        `apparatus` the name of the bench test.
    """
    # Before version 0.5 a record had only a hash of its settings.
    has_settings = isinstance(record["settings"], Mapping)
    if record["verb"] not in COMPARED_STAGES or not has_settings:
        return False

    # The study has no settings to compare if it lacks the bench test or the strategy. A
    # bench test in the study has a section with its name, so look for it among the
    # sections.
    bench_test_name = record.get("apparatus")
    has_bench_test = bench_test_name in (None, OWN_BENCH, *config)
    strategy_name = record.get("strategy")
    has_strategy = strategy_name is None or strategy_name in strategies.names()
    return has_bench_test and has_strategy


def _find_first_difference(recorded: Any, current: Any, prefix: str = "") -> Difference:
    """Find the first single setting that differs between a result and the study.

    The function calls itself for sections, until it reaches a single setting. A key
    that one side lacks has the value None there.

    Parameters
    ----------
    recorded, current : object
        Settings of a result and of the study, or parts of them. They must differ.
    prefix : str, optional
        Dotted key of these parts, with a leading dot; empty for the whole settings.

    Returns
    -------
    Difference
        The dotted key of the setting, and both of its values.
    """
    # In two sections, look for the first key whose values differ.
    if isinstance(recorded, Mapping) and isinstance(current, Mapping):
        for key in _sort_keys_with_scene_last({*recorded, *current}):
            recorded_part = recorded.get(key)
            current_part = current.get(key)
            if recorded_part != current_part:
                inner_prefix = f"{prefix}.{key}"
                return _find_first_difference(recorded_part, current_part, inner_prefix)

    # In two lists of sections, look for the first section that differs. A list of plain
    # values, such as a range, is reported as a whole.
    if _are_lists_of_same_length(recorded, current):
        for position, recorded_part in enumerate(recorded):
            current_part = current[position]
            if recorded_part != current_part and isinstance(recorded_part, Mapping):
                inner_prefix = f"{prefix}.{position}"
                return _find_first_difference(recorded_part, current_part, inner_prefix)

    # Any other two values differ as a whole.
    return Difference(prefix.removeprefix("."), recorded=recorded, current=current)


def _sort_keys_with_scene_last(keys: Iterable[str]) -> list[str]:
    """Sort keys in alphabetical order, with the key of the scene last.

    The scene is a hash, so a user learns more from the keys that it combines.
    """
    return sorted(keys, key=lambda key: (key == SCENE, key))


def _are_lists_of_same_length(one: Any, other: Any) -> bool:
    """Tell whether two values are lists of the same length."""
    return isinstance(one, list) and isinstance(other, list) and len(one) == len(other)


def require_same_study(config: Config, inputs: Inputs, source: str) -> None:
    """Raise InputError if an input of a stage was made with other settings.

    Only the first such input is reported. The engine is not compared, because a stage
    may read results of an earlier engine.

    Parameters
    ----------
    config : mapping
        The resolved configuration of the stage.
    inputs : iterable of (Path, mapping or None)
        Files with their records of provenance.
    source : str
        The file of the configuration, for the message.
    """
    for path, record in inputs:
        difference = find_difference(config, record, compare_engine=False)
        if difference is None:
            continue

        # If the value of a key is the path of a file, `find_difference` compares hashes
        # of its content. A hash of None means that the file is missing, probably
        # because the user called the subcommand in another folder.
        named_file = get_value(config, difference.key)
        if difference.current is None and isinstance(named_file, str):
            raise InputError(
                source,
                key=difference.key,
                value=named_file,
                allowed=f"the path of an existing file, which {path} depends on; the path is "
                "relative to the folder in which you call repose",
            )
        raise InputError(
            path,
            key=difference.key,
            value=difference.recorded,
            allowed=f"{difference.current}, as in {source}, because all files must be results of "
            f"one study; give the configuration with which {path} was made, or make {path} "
            f"again with {source}",
        )


def find_outdated_files(config: Config, paths: Iterable[str | PathLike]) -> list[str]:
    """Find the results that were made with other settings or by another engine.

    Parameters
    ----------
    config : mapping
        A resolved configuration.
    paths : iterable of path
        Files that exist. Files without a record are ignored.

    Returns
    -------
    list of str
        The paths of such results.
    """
    return [
        str(path)
        for path in paths
        if find_difference(config, attached.read_record(path))
    ]


def find_own_dataset(config: Config) -> Path | None:
    """Find the table of samples in the study's own folder of results.

    Parameters
    ----------
    config : mapping
        The resolved configuration.

    Returns
    -------
    Path or None
        The path of dataset.csv. None if the table is missing or lacks piles of the
        study, or if the table, a pile or the grain was made with other settings.
    """
    # The piles are the measured samples of the funnel, which is the unnamed bench test.
    folder = Path(config["results_dir"])
    table = folder / "dataset.csv"
    piles = list(folder.glob(f"{name_run_folder(UNNAMED)}/*.json"))
    if not piles:
        return None

    # Every file must have a record of provenance, and the settings of the study. A
    # missing file has no record either.
    grain_files = folder.glob("berry/*.json")
    files = [*grain_files, *piles, table]
    lacks_records = any(attached.read_record(path) is None for path in files)
    if lacks_records or find_outdated_files(config, files):
        return None

    # A pile that was written after the table is not in it.
    newest_pile_s = max(path.stat().st_mtime for path in piles)
    is_complete = table.stat().st_mtime >= newest_pile_s
    return table if is_complete else None
