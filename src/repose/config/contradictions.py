"""Rules between keys: each reports values that contradict each other."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

from repose.apparatus import bench_tests, names
from repose.apparatus.bench_test import BenchTest
from repose.config import results_folder
from repose.core.parameter_space import ParameterSpace
from repose.core.responses import responses_of

LARGEST_BLOCKS = 100  # of a refined proposal's pours: jobs of a round have three digits
MODULI = ("berry.poisson_ratio", "berry.shear_modulus_pa")

Pairs = Iterator[tuple[str, str]]


class Rule(NamedTuple):
    """A rule between keys."""

    reads: tuple[str, ...]  # dotted keys or sections; the rule is applied if each is valid by itself
    faults: Callable[[Mapping[str, Any]], Pairs]  # faults(config) yields (dotted key, what is allowed)


def rules(config: Mapping[str, Any]) -> list[Rule]:
    """The rules for a configuration, those of its bench tests included."""
    used = used_tests(config)
    return [
        Rule(("measure.fit_from", "measure.fit_to"), _of_the_fit),
        Rule(("targets",), _of_targets),
        *(Rule((test.name, "simulation"), test.contradictions) for test in used),
        Rule(("results_dir",), lambda config: results_folder.contradictions(config["results_dir"])),
        Rule(("berry.compression", *MODULI), _of_moduli),
        Rule(("network.split",), _of_the_split),
        Rule(("parameters",), _of_parameters),
        Rule(("surrogate", "parameters", "network.split", "design.samples"), _of_the_surrogate),
        Rule(("network.replicates", "targets", *(f"{test.name}.seeds" for test in used)), _of_seeds),
        Rule(
            ("strategy", "sequential", "response_surface", "targets", "parameters"), strategy_contradictions
        ),
        Rule(("refine",), _of_refine),
        Rule(("miga",), _of_miga),
    ]


def used_tests(config: Mapping[str, Any]) -> list[BenchTest]:
    """Bench tests whose section is in the configuration."""
    return [test for test in bench_tests() if test.name in config]


def _of_moduli(config):
    """Neither moduli nor compression tests."""
    for key in MODULI:
        name = key.removeprefix("berry.")
        if config["berry"]["compression"] is None and config["berry"][name] is None:
            yield (
                key,
                "a number; or a table of compression tests in berry.compression, which tells both moduli",
            )


def _of_parameters(config):
    """No free parameter."""
    if not ParameterSpace.of(config["parameters"]).free:
        yield "parameters", "at least one that is not fixed: there is nothing to calibrate"


def _of_the_split(config):
    """Invalid shares."""
    split = config["network"]["split"]
    if abs(sum(split) - 1) > 1e-6 or split[0] == 0 or split[2] == 0:
        yield "network.split", "three shares that sum to 1, those of training and test above 0"


def _of_refine(config):
    """Impossible numbers of jobs or neighbours."""
    refine = config["refine"]
    if refine["seeds"] > LARGEST_BLOCKS * refine["block"]:
        yield "refine.block", f"at least refine.seeds / {LARGEST_BLOCKS}"
    if refine["neighbours"] == 1:
        yield "refine.neighbours", "0 or at least 2: they fill a Latin hypercube"


def _of_miga(config):
    """A tournament larger than its population."""
    if config["miga"]["tournament"] > config["miga"]["population"]:
        yield "miga.tournament", f"at most miga.population, {config['miga']['population']}"


def _of_the_surrogate(config):
    """Too few samples for a quadratic surface: a constant, linear terms, squares and products, and one sample more."""
    free = ParameterSpace.of(config["parameters"]).dimensions
    needed = (free + 1) * (free + 2) // 2 + 1
    training = int(config["network"]["split"][0] * config["design"]["samples"] + 1e-9)
    if config["surrogate"] == "quadratic" and training < needed:
        allowed = "network or gaussian_process where design.samples times the first of network.split is below"
        yield "surrogate", f"{allowed} {needed}"


def strategy_contradictions(config: Mapping[str, Any]) -> Pairs:
    """A sequential start beyond its budget or without repeats; a response surface of too few factors or runs.

    Each value of the configuration is valid by itself. Yields (dotted key, what is allowed).
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


def _of_seeds(config):
    """Too few runs of a sample to compare them, in a bench test of the targets."""
    network = config["network"]
    targets = {target["apparatus"] for target in config["targets"]}
    for name in (test.name for test in used_tests(config) if test.name in targets):
        seeds = config[name]["seeds"]
        if network["replicates"] and seeds < 2:
            yield (
                "network.replicates",
                f"false where {name}.seeds is 1: runs of one sample cannot be compared",
            )


def _of_targets(config):
    """Targets without a bench test, duplicates, and values outside the allowed range."""
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


def _of_the_fit(config):
    """A part of the flank that is too short for a line."""
    start, end = config["measure"]["fit_from"], config["measure"]["fit_to"]
    if start == end == "berry":
        yield "measure.fit_to", "a number from 0.1 to 1, as measure.fit_from is berry"
    elif "berry" not in (start, end) and end < start + 0.1:
        yield "measure.fit_to", f"at least 0.1 above measure.fit_from, {start:g}"
