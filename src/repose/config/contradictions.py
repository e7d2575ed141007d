"""Rules between sections: each reports values that contradict each other.

Rules between the keys of one section stand in its model (`repose.core.section.Section.contradictions`).
"""

from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

from repose.apparatus import bench_tests
from repose.apparatus.bench_test import BenchTest
from repose.core.parameter_space import ParameterSpace

Pairs = Iterator[tuple[str, str]]


class Rule(NamedTuple):
    """A rule between sections."""

    reads: tuple[
        str, ...
    ]  # sections, and keys outside sections; the rule is applied if none of them has a fault
    faults: Callable[[Mapping[str, Any]], Pairs]  # faults(config) yields (dotted key, what is allowed)


def rules(config: Mapping[str, Any]) -> list[Rule]:
    """The rules for a configuration, those of its bench tests included."""
    used = used_tests(config)
    return [
        Rule(("targets",), _of_targets),
        *(Rule((test.name, "simulation"), test.contradictions) for test in used),
        Rule(("surrogate", "parameters", "network", "design"), _of_the_surrogate),
        Rule(("network", "targets", *(test.name for test in used)), _of_seeds),
        Rule(
            ("strategy", "sequential", "response_surface", "targets", "parameters"), strategy_contradictions
        ),
    ]


def used_tests(config: Mapping[str, Any]) -> list[BenchTest]:
    """Bench tests whose section is in the configuration."""
    return [test for test in bench_tests() if test.name in config]


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
            yield "sequential.seeds", "at least 2: the noise comes from pours of one sample"
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
    """Targets of a bench test that the configuration lacks, and responses that stand twice."""
    seen = set()
    for k, target in enumerate(config["targets"]):
        if target["apparatus"] not in config:
            yield f"targets.{k}.apparatus", "a bench test that has a section of its name in the configuration"
        if target["response"] in seen:
            yield f"targets.{k}.response", "each response once"
        seen.add(target["response"])
