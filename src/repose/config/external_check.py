"""Write the lines of `repose check` for a study whose runs are made by another program."""

import shlex
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from repose.calibrate.parameter_types import describe_wide_ranges
from repose.calibrate.strategies import strategy
from repose.calibrate.study_file import list_unread_keys
from repose.calibrate.targets import Targets
from repose.common.errors import InputError
from repose.common.files import StrPath
from repose.common.numbers import format_significant
from repose.common.statuses import describe_failure
from repose.config import loader
from repose.config.cost import (
    Pours,
    count_runs,
    list_article_pours,
    list_strategy_pours,
)
from repose.config.external import convert_to_short_form, list_unread_sections
from repose.config.models import StudySettings
from repose.config.pipeline import PipelineConfig
from repose.stages import simulate, simulated
from repose.stages.settings import SimulatorSettings


def describe_program(
    study: PipelineConfig, simulator: SimulatorSettings
) -> Iterator[str]:
    """Describe the program of a study, its deck, and the files with its responses.

    Parameters
    ----------
    study : PipelineConfig
        The study.
    simulator : SimulatorSettings
        The section `simulator` of the study.

    Yields
    ------
    str
        A line of text.
    """
    program = simulate.find_program(simulator.command)
    yield f"{simulator.name}: {shlex.join(simulator.command)}; the program is {program}"
    yield from _describe_deck(study, simulator)
    for sentence in describe_wide_ranges(study.config["parameters"]):
        yield f"ranges: WARNING: {sentence}"
    files = ", ".join(simulator.files_read)
    yield f"responses: {', '.join(study.targets.names)}, from {files}"
    yield (
        f"a run: cores {simulator.cores}, memory {simulator.memory_mb} MB, at most "
        f"{simulator.time_limit_s:g} s"
    )


def _describe_deck(
    study: PipelineConfig, simulator: SimulatorSettings
) -> Iterator[str]:
    """Describe the deck, which is the input file with the values of the parameters.

    If the program has a deck, a line follows for each fixed parameter that the deck
    does not name.
    """
    if simulator.template is None:
        yield f"deck: no deck; the program reads {simulate.PARAMETERS_FILE}"
        return
    deck = simulate.deck_name(simulator.template)
    yield f"deck: {deck}, from {simulator.template}"
    used_names = simulate.find_used_names(simulator)
    for name, value in study.parameters.fixed.items():
        if name not in used_names:
            yield (
                f"{name} is fixed at {value:g}, and the deck does not use this name; "
                "the deck must state the number that its program needs for it, as a "
                "deck of `repose export` does"
            )


def describe_strategy(study: PipelineConfig, files: Sequence[StrPath]) -> Iterator[str]:
    """Describe the strategy of a study, and list keys in its files that have no effect.

    Parameters
    ----------
    study : PipelineConfig
        The study.
    files : sequence of path
        The files of the study.

    Yields
    ------
    str
        A line of text.
    """
    assert study.simulator is not None
    name = study.settings.strategy
    surrogate = ""
    if strategy(name).begins_with_design:
        surrogate = f", surrogate {study.settings.surrogate}"
    yield f"strategy: {name}{surrogate}"

    # List the keys that the strategy does not read.
    merged = loader.merge_without_defaults(files)
    short_form = convert_to_short_form(merged).config
    keys = list_unread_keys({**short_form, "simulator": study.simulator.name})
    if keys:
        yield f"keys: the strategy {name} does not read {', '.join(keys)}"

    # List the sections that only our simulator reads.
    sections = list_unread_sections(merged.config)
    if sections:
        yield (
            f"keys: {study.simulator.name} makes the runs, so these are not read: "
            f"{', '.join(sections)}; the program's own input must agree with them"
        )


def list_runs(settings: StudySettings) -> Pours:
    """List the runs of a study.

    Returns
    -------
    sequence of (str, int, int)
        Purpose, number of parameter sets, and runs of each set.
    """
    name = settings.strategy
    strategy_runs = list_strategy_pours(settings, name) or ()
    if not strategy(name).begins_with_design:
        return strategy_runs

    # The runs of a program belong to no bench test.
    return (*list_article_pours(settings, test=""), *strategy_runs)


def _compare_with_targets(targets: Targets, run: Mapping[str, Any]) -> Iterator[str]:
    """Write a line for each target: the response of a run, the target and its range.

    Parameters
    ----------
    targets : Targets
        The targets of the study.
    run : mapping
        The measured run; each response has its name as key.

    Yields
    ------
    str
        A line of text.
    """
    for target in targets:
        unit = f" {target.response.unit}".rstrip()
        response = format_significant(run[target.name])
        low = format_significant(target.low)
        high = format_significant(target.high)
        yield (
            f"  {target.name} {response}{unit}; the target is {target.value:g}{unit}, "
            f"{low} to {high}"
        )


def make_trial_run(
    study: PipelineConfig, simulator: SimulatorSettings, cores: int
) -> Iterator[str]:
    """Make one run at the centre of the ranges, and describe its responses.

    Parameters
    ----------
    study : PipelineConfig
        The study.
    simulator : SimulatorSettings
        The section `simulator` of the study.
    cores : int
        Number of cores of the study, for the estimate of the time of all runs.

    Yields
    ------
    str
        A line of text.

    Raises
    ------
    InputError
        If the run failed. The folder of the run is not removed.
    """
    # Run the program in a new folder, in which run 1 has a folder and a record.
    parameters = study.parameters.centre
    folder = Path(tempfile.mkdtemp(prefix="repose_try_"))
    run_folder = folder / "1"
    record_json = folder / "1.json"
    start_s = time.perf_counter()
    record = simulate.run_once(
        simulator,
        parameters,
        sample=1,
        run=1,
        seed=simulate.draw_seed(study.settings.design.seed, "design", 1, 1),
        out_dir=folder,
    )
    elapsed_s = time.perf_counter() - start_s

    # Read the responses of the run, or measure its pile.
    job = simulated.measure_sample(
        [record_json],
        folder / "measured.json",
        settings=simulator,
        responses=study.targets.names,
        measure=study.settings.measure,
    )
    run: Mapping[str, Any] = job["runs"][0]
    if run["status"] != simulate.OK:
        raise InputError(
            run_folder,
            key="trial run",
            value=describe_failure(run["status"], run["reason"]),
            allowed=f"a run that ends normally; {simulate.PRINTED_FILE} there has what the "
            "program printed",
        )

    # Compare the responses with the targets.
    point = ", ".join(
        f"{name} {format_significant(value)}" for name, value in parameters.items()
    )
    yield f"trial run, seed {record['seed']}, {elapsed_s:.1f} s, at {point}:"
    yield from _compare_with_targets(study.targets, run)
    yield f"its files: {run_folder}"

    # Estimate the time of the study from that of this run.
    n_runs = count_runs(list_runs(study.settings))
    hours = n_runs * elapsed_s * simulator.cores / cores / 3600
    yield (
        f"{n_runs} runs as long as this one: about {format_significant(hours, 2)} h on {cores} cores"
    )
