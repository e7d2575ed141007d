"""Checks of the keys of a configuration against each other and against the files that they name."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from repose.apparatus import bench_tests, names
from repose.apparatus.settings import SimulationSettings
from repose.config import results_folder
from repose.config.reading import Origin, get, origin_of
from repose.config.schema import input_errors, validator
from repose.core.errors import InputError, raise_together
from repose.core.parameter_space import ParameterSpace, range_of
from repose.core.parameters import PARAMETERS
from repose.core.published import beside, check_published, published_sets
from repose.core.responses import responses_of
from repose.core.targets import Targets

if TYPE_CHECKING:
    from repose.dem.time_steps import Limit
    from repose.particle.particle import Particle

LARGEST_BLOCKS = 100  # of a refined proposal's pours: jobs of a round have three digits


def check(config: dict[str, Any], source: str | Origin = "configuration") -> dict[str, Any]:
    """Check a configuration by its schema and by the rules between keys.

    Keys of the file's inputs are left to `check_inputs`.

    Parameters
    ----------
    config : dict
    source : str or Origin, optional
        Name of the file, for the message.

    Returns
    -------
    dict
        The same configuration.

    Raises
    ------
    InputError
        For all faults at once; contradictions are looked for where each key alone is right.
    """
    raise_together(input_errors(validator().iter_errors(config), config, source))
    raise_together(_faults(_contradictions(config), config, source))
    return config


def check_inputs(config: dict[str, Any], source: str | Origin = "configuration") -> None:
    """Check the files that a checked configuration names, and that berry, bench test and time step fit together.

    The berry's particle is made for it, and the engine is asked how long a time step may be.

    Parameters
    ----------
    config : dict
    source : str or Origin, optional
        Name of the file, for the message.

    Raises
    ------
    InputError
        For all faults at once.
    """
    raise_together(
        [
            *_faults(results_folder.taken(config["results_dir"]), config, source),
            *_faults(_missing_files(config), config, source),
        ]
    )
    from repose.particle import build

    faults: list[InputError] = []
    mean = _found(faults, _mean_berry, config)
    responses = Targets.of(config["targets"]).responses
    _found(faults, check_published, config["validation"]["published"], responses)
    if mean is not None:
        faults += _faults(_misfits(config, mean), config, source)
        particle = _found(faults, build.of_settings, mean, config["berry"])
        if particle is not None and not faults:
            faults += _faults(_unstable(config, particle, mean), config, source)
    raise_together(faults)


def _found(faults, function, *arguments):
    """What a function gives, or None and one fault more."""
    try:
        return function(*arguments)
    except InputError as fault:
        faults.append(fault)
        return None


def _faults(pairs, config, source):
    """Pairs (dotted key, what is allowed) as faults."""
    return [InputError(origin_of(source, key), key, get(config, key), allowed) for key, allowed in pairs]


def _missing_files(config):
    """Files that the configuration names and that are not there."""
    for key in (
        "berry.sizes",
        "berry.compression",
        "berry.stl",
        "validation.published",
        "posterior.shape_study",
    ):
        path = get(config, key)
        if path is not None and not Path(path).is_file():
            yield key, "an existing file, seen from the project's folder"


def _mean_berry(config):
    """The mean berry of the configuration's files."""
    from repose.particle import berry

    section = config["berry"]
    material = section["density_kg_m3"], section["poisson_ratio"], section["shear_modulus_pa"]
    table1 = beside(config["validation"]["published"], "table1.csv")
    return berry.of_files(section["sizes"], section["compression"], table1, *material)[1]


def _misfits(config, mean):
    """Where the mean berry does not go with a bench test."""
    from repose.particle import berry

    for test in _used(config):
        yield from test.misfits(config, [mean[column] for column in berry.SIZE_COLUMNS])


def longest_step(config: Mapping[str, Any], particle: "Particle", mean: Mapping[str, Any]) -> "Limit":
    """The longest time step that the engine takes for every set of parameters of a study and its published table.

    Parameters
    ----------
    config : mapping
        The whole configuration.
    particle : Particle
    mean : mapping
        What the verb ``berry`` writes.

    Returns
    -------
    repose.dem.time_steps.Limit
    """
    from repose.apparatus.scene import longest_time_step

    sets = [{name: range_of(name, config["parameters"][name])[0] for name in PARAMETERS}]
    sets += published_sets(config["validation"]["published"])
    lowest = {name: min(one[name] for one in sets) for name in PARAMETERS}
    return longest_time_step(config, lowest, particle, mean)


def _unstable(config, particle, mean):
    """A time step that the engine would refuse."""
    limit = longest_step(config, particle, mean)
    if SimulationSettings.of(config).time_step_s > limit.time_step_s:
        yield "simulation.time_step_s", limit.allowed


def _contradictions(config):
    """Pairs (dotted key, what is allowed) where a value does not go with another one."""
    yield from _fit_contradictions(config)
    yield from _target_contradictions(config)
    for test in _used(config):
        yield from test.contradictions(config)
    yield from results_folder.contradictions(config["results_dir"])
    berry, network = config["berry"], config["network"]
    if berry["compression"] is None and None in (berry["poisson_ratio"], berry["shear_modulus_pa"]):
        yield (
            "berry.compression",
            "a path of a file, unless poisson_ratio and shear_modulus_pa are both given",
        )
    if abs(sum(network["split"]) - 1) > 1e-6 or network["split"][0] == 0 or network["split"][2] == 0:
        yield "network.split", "three shares that sum to 1, those of training and test above 0"
    yield from _surrogate_contradictions(config)
    yield from _seed_contradictions(config)
    yield from strategy_contradictions(config)
    refine = config["refine"]
    if refine["seeds"] > LARGEST_BLOCKS * refine["block"]:
        yield "refine.block", f"at least refine.seeds / {LARGEST_BLOCKS}"
    if refine["neighbours"] == 1:
        yield "refine.neighbours", "0 or at least 2: they fill a Latin hypercube"
    if config["miga"]["tournament"] > config["miga"]["population"]:
        yield "miga.tournament", f"at most miga.population, {config['miga']['population']}"


def _surrogate_contradictions(config):
    """Too few samples for a quadratic surface: a constant, linear terms, squares and products, and one sample more."""
    free = ParameterSpace.of(config["parameters"]).dimensions
    needed = (free + 1) * (free + 2) // 2 + 1
    training = int(config["network"]["split"][0] * config["design"]["samples"] + 1e-9)
    if config["surrogate"] == "quadratic" and training < needed:
        allowed = "network or gaussian_process where design.samples times the first of network.split is below"
        yield "surrogate", f"{allowed} {needed}"


def strategy_contradictions(config: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """A sequential start beyond its budget or without repeats; a response surface of too few factors or runs.

    Parameters
    ----------
    config : mapping
        Whose values are allowed, each by itself.

    Yields
    ------
    tuple of (str, str)
        Dotted key, and what is allowed.
    """
    if config["strategy"] == "sequential":
        section, responses = config["sequential"], len(config["targets"])
        repeats = section["start_samples"] * (section["seeds"] - 1)
        if repeats <= responses:
            yield "sequential.seeds", "at least 2: pours of one sample tell the noise"
        if section["start_samples"] * section["seeds"] > section["most_pours"]:
            yield "sequential.most_pours", "at least sequential.start_samples times sequential.seeds"
    if config["strategy"] != "response_surface":
        return
    section, free = config["response_surface"], ParameterSpace.of(config["parameters"]).dimensions
    name = section["surface"]
    fewest, centres = (3, 3) if name == "box_behnken" else (2, 1)
    if free < fewest:
        yield "response_surface.surface", f"a design for {free} free parameters; {name} needs {fewest}"
    if section["most_factors"] < fewest:
        yield "response_surface.most_factors", f"at least {fewest} where surface is {name}"
    if section["screening_runs"] < free + 2:
        yield "response_surface.screening_runs", f"at least {free + 2} for {free} free parameters"
    if section["centres"] < centres:
        yield "response_surface.centres", f"at least {centres} where surface is {name}"


def _seed_contradictions(config):
    """Too few runs of a sample, in a bench test of the targets, for what the training wants to know of them."""
    network = config["network"]
    targets = {target["apparatus"] for target in config["targets"]}
    for name in (test.name for test in _used(config) if test.name in targets):
        seeds = config[name]["seeds"]
        if network["replicates"] and seeds < 2:
            yield (
                "network.replicates",
                f"false where {name}.seeds is 1: runs of one sample cannot be compared",
            )


def _target_contradictions(config):
    """Targets that no bench test gives, given twice, or outside of their own range."""
    seen = set()
    for k, target in enumerate(config["targets"]):
        key = f"targets.{k}"
        known = responses_of(target["apparatus"])
        if not known:
            yield f"{key}.apparatus", f"one of {', '.join(names())}"
            continue
        if target["apparatus"] not in config:
            yield f"{key}.apparatus", "a bench test that has a section of its name in the configuration"
        given = [one.name for one in known]
        if target["response"] not in given:
            yield f"{key}.response", f"one of {', '.join(given)}, the responses of {target['apparatus']}"
            continue
        if target["response"] in seen:
            yield f"{key}.response", "each response once"
        seen.add(target["response"])
        limits = known[given.index(target["response"])]
        low, high = target["range"]
        if low < limits.low or high > limits.high:
            yield f"{key}.range", f"a pair [low, high] from {limits.low:g} to {limits.high:g}"
            continue
        if not limits.low <= target["value"] <= limits.high:
            yield f"{key}.value", f"from {limits.low:g} to {limits.high:g}"
        aimed = "aim" if "aim" in target else "value"
        if not low <= target[aimed] <= high:
            yield f"{key}.{aimed}", f"inside {key}.range, {low:g} to {high:g}"


def _fit_contradictions(config):
    """A part of the flank that is too short for a line."""
    start, end = config["measure"]["fit_from"], config["measure"]["fit_to"]
    if start == end == "berry":
        yield "measure.fit_to", "a number from 0.1 to 1, as measure.fit_from is berry"
    elif "berry" not in (start, end) and end < start + 0.1:
        yield "measure.fit_to", f"at least 0.1 above measure.fit_from, {start:g}"


def _used(config):
    """Bench tests that have a section in the configuration."""
    return [test for test in bench_tests() if test.name in config]
