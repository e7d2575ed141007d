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
from repose.calibrate.units import describe_other_units
from repose.common.errors import InputError
from repose.common.files import StrPath
from repose.common.numbers import format_significant
from repose.common.statuses import describe_failure
from repose.config import loader
from repose.config.cost import (
    PlannedRuns,
    count_runs,
    list_article_runs,
    list_strategy_runs,
)
from repose.config.external import convert_to_short_form, list_unread_sections
from repose.config.models import StudySettings
from repose.config.pipeline import PipelineConfig
from repose.stages import simulate, simulated
from repose.stages.settings import SimulatorSettings

# The numbers of the sample and of the run that a trial run stands for.
TRIAL_SAMPLE = 1
TRIAL_RUN = 1


def describe_program(
    study: PipelineConfig, simulator: SimulatorSettings
) -> Iterator[str]:
    """Describe the program of a study, its input script, and its files of results.

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
    yield from _describe_input_script(study, simulator)
    # Warn about parameter ranges that are suspiciously wide.
    for sentence in describe_wide_ranges(study.config["parameters"]):
        yield f"ranges: WARNING: {sentence}"
    files = ", ".join(simulator.files_read)
    yield f"responses: {', '.join(study.targets.names)}, from {files}"
    yield (
        f"resources of a run: cores {simulator.cores}, memory {simulator.memory_mb} MB, "
        f"at most {simulator.time_limit_s:g} s"
    )


def _describe_input_script(
    study: PipelineConfig, simulator: SimulatorSettings
) -> Iterator[str]:
    """Describe the input script of the program, called its deck in messages.

    The script is made from a template, in which names stand for the values of the
    parameters. Without a template there is no script. A line follows for each fixed
    parameter whose name does not occur in the template.
    """
    if simulator.template is None:
        yield f"deck: none; the program reads {simulate.PARAMETERS_FILE}"
        return
    script_name = simulate.deck_name(simulator.template)
    yield f"deck: {script_name}, from {simulator.template}"
    used_names = simulate.find_used_names(simulator)
    for name, value in study.parameters.fixed.items():
        if name not in used_names:
            yield (
                f"{name} is fixed at {format_significant(value)}, but the deck does not use this name; "
                "make sure that the deck has the number that the program needs for it, "
                "as a deck of `repose export` does"
            )


def describe_strategy(study: PipelineConfig, files: Sequence[StrPath]) -> Iterator[str]:
    """Describe the strategy of a study, and list keys in its files that have no effect.

    Parameters
    ----------
    study : PipelineConfig
        The study. Another program makes its runs.
    files : sequence of path
        The files of the study.

    Yields
    ------
    str
        A line of text.
    """
    # Only a study with another program has this section.
    assert study.simulator is not None
    strategy_name = study.settings.strategy
    surrogate = ""
    if strategy(strategy_name).begins_with_design:
        surrogate = f", surrogate {study.settings.surrogate}"
    yield f"strategy: {strategy_name}{surrogate}"

    # List the keys in the user's files that the strategy does not read. The files may
    # be written for our simulator, but `list_unread_keys` reads only the short form of
    # a study with a program, and expects only the name of the program in `simulator`.
    merged = loader.merge_without_defaults(files)
    short_form = convert_to_short_form(merged).config
    unread_keys = list_unread_keys({**short_form, "simulator": study.simulator.name})
    if unread_keys:
        yield (
            f"keys: the strategy {strategy_name} does not read {', '.join(unread_keys)}"
        )

    # List the sections that have an effect only if this package makes the runs.
    unread_sections = list_unread_sections(merged.config)
    if unread_sections:
        yield (
            f"keys: {study.simulator.name} makes the runs, so these are not read: "
            f"{', '.join(unread_sections)}; make sure that the program's own input agrees "
            "with them"
        )


def list_runs(settings: StudySettings) -> PlannedRuns:
    """List the runs of a study whose runs are made by another program.

    Returns
    -------
    sequence of (str, int, int)
        Purpose, number of parameter sets, and runs of each set.
    """
    name = settings.strategy
    strategy_runs = list_strategy_runs(settings, name) or ()
    if not strategy(name).begins_with_design:
        return strategy_runs

    # The runs of a program belong to no bench test.
    return (*list_article_runs(settings, test=""), *strategy_runs)


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
        value = format_significant(target.value)
        yield (
            f"  {target.name} {response}{unit}; the target is {value}{unit}, "
            f"{low} to {high}"
        )


def make_trial_run(
    study: PipelineConfig, simulator: SimulatorSettings, cores: int
) -> Iterator[str]:
    """Make one run at the centre of the parameter ranges, and describe its responses.

    The run begins when the first line is requested. Its files stay in a temporary
    folder, so that the user can look at them.

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
        If the run failed.
    """
    # Run the program in a new folder. `simulate.run_once` gives the run a folder and a
    # record, both named by its number. The seed is that of run 1 of sample 1 of the
    # design.
    parameters = study.parameters.centre
    folder = Path(tempfile.mkdtemp(prefix="repose_try_"))
    run_folder = folder / str(TRIAL_RUN)
    record_json = folder / f"{TRIAL_RUN}.json"
    start_s = time.perf_counter()
    record = simulate.run_once(
        simulator,
        parameters,
        sample=TRIAL_SAMPLE,
        run=TRIAL_RUN,
        seed=simulate.draw_seed(
            study.settings.design.seed, "design", TRIAL_SAMPLE, TRIAL_RUN
        ),
        out_dir=folder,
    )
    elapsed_s = time.perf_counter() - start_s

    # Read the responses of the run, or measure its pile.
    measured_sample = simulated.measure_sample(
        [record_json],
        folder / "measured.json",
        settings=simulator,
        responses=study.targets.names,
        measure=study.settings.measure,
    )
    run: Mapping[str, Any] = measured_sample["runs"][0]
    if run["status"] != simulate.OK:
        raise InputError(
            run_folder,
            key="trial run",
            value=describe_failure(run["status"], run["reason"]),
            allowed=f"a run that ends normally; {simulate.PRINTED_FILE} there has what the "
            "program printed",
        )

    # Compare the responses with the targets.
    parameters_text = ", ".join(
        f"{name} {format_significant(value)}" for name, value in parameters.items()
    )
    yield f"trial run, seed {record['seed']}, {elapsed_s:.1f} s, at {parameters_text}:"
    yield from _compare_with_targets(study.targets, run)
    responses = {name: [run[name]] for name in study.targets.names}
    for sentence in describe_other_units(study.targets, responses).values():
        yield f"  WARNING: {sentence}"
    yield f"its files: {run_folder}"

    # Estimate the time of the study from the time of this run. A run occupies
    # `simulator.cores` of the cores, so cores / simulator.cores runs go on at once.
    n_runs = count_runs(list_runs(study.settings))
    hours = n_runs * elapsed_s * simulator.cores / cores / 3600
    hours_text = format_significant(hours, 2)
    yield f"{n_runs} runs as long as this one: about {hours_text} h on {cores} cores"
