"""Figures from the workflow's own tables, with the paper's numbers if the paper has a counterpart."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from repose.core.errors import InputError

from . import (
    bench_scenes,
    berries,
    checks,
    discrepancy,
    measuring,
    plane,
    refinement,
    region,
    response_surface,
    rotation,
    samples,
    search,
    sequential,
    style,
    surrogate,
    testbench,
    uncertainty,
    workflow,
)

# Name of a figure: the function that draws it and the inputs it needs; inputs in OPTIONAL may be left out.
FIGURES = {
    "figure02": (berries.sizes_and_sphericity, ("sizes",)),
    "figure05": (testbench.simulated_pile, ("heap", "particle")),
    "figure06": (testbench.measurement, ("heap", "particle", "berry")),
    "figure07": (berries.particle_and_mesh, ("stl", "particle")),
    "figure08": (testbench.apparatus, ()),
    "figure09": (workflow.rule_graph, ("dot",)),
    "figure10": (surrogate.network_structure, ("network",)),
    "figure13": (surrogate.predicted_against_simulated, ("predictions", "dataset")),
    "figure14": (search.feasible_solutions, ("feasible", "summary")),
    "figure15": (rotation.states, ("states", "particle")),
    "definitions": (measuring.definitions, ("heap", "particle", "berry")),
    "drum": (rotation.course, ("record", "profile", "runs")),
    "convergence": (search.convergence, ("history",)),
    "plane": (plane.planes, ("dataset", "feasible", "table4")),
    "design": (samples.design_matrix, ("samples",)),
    "dataset": (samples.responses_over_parameters, ("dataset",)),
    "validation": (checks.validation, ("table4",)),
    "published": (checks.published_solutions, ("published",)),
    "noise": (uncertainty.noise_floor, ("runs", "seeds", "noise")),
    "corner": (uncertainty.corner, ("draws", "posterior", "summary", "feasible")),
    "intervals": (uncertainty.intervals, ("posterior",)),
    "discrepancy": (discrepancy.over_the_discrepancy, ("discrepancy",)),
    "region": (region.not_excluded, ("region", "summary")),
    "sobol": (uncertainty.sobol_indices, ("sobol",)),
    "approach": (refinement.approach, ("rounds",)),
    "pareto_screening": (response_surface.pareto, ("effects",)),
    "pareto_surface": (response_surface.pareto, ("effects",)),
    "perturbation": (response_surface.perturbation, ("samples", "dataset")),
    "contours": (response_surface.contours, ("samples", "dataset", "optimum")),
    "sequential": (sequential.sequential, ("batches", "check")),
    "lifted_cylinder": (bench_scenes.lifted_cylinder, ()),
    "inclined_plane": (bench_scenes.inclined_plane, ()),
    "drop_test": (bench_scenes.drop_test, ()),
    "drawdown": (bench_scenes.drawdown, ()),
    "main_effects": (uncertainty.main_effects, ("effects", "dataset", "sobol")),
}
OPTIONAL = {
    "approach": ("summary",),
    "figure08": ("trajectory", "particle"),
    "figure14": ("published",),
    "convergence": ("summary",),
    "design": ("comparison",),
    "drawdown": ("runs", "particle"),
    "lifted_cylinder": ("runs", "particle"),
    "plane": ("pool", "fresh"),
    "validation": ("published",),
}


def draw(
    name: str,
    inputs: Mapping[str, Any],
    out_path: str | Path,
    config: Mapping[str, Any],
    known: Mapping[str, Any] = FIGURES,
) -> None:
    """Draw one of the `known` figures to a PNG; `inputs` are paths by input name.

    Raises InputError for an unknown figure or a wrong, missing or unusable input.
    """
    if name not in known:
        raise InputError("figures", "name", name, ", ".join(known))
    function, needed = known[name]
    allowed = needed + OPTIONAL.get(name, ())
    for key in [*needed, *inputs]:
        if key not in allowed or key not in inputs:
            raise InputError(f"figure {name}", "inputs", key, f"needs {needed}, may have {allowed}")
        if not Path(inputs[key]).is_file():
            raise InputError(f"figure {name}", key, str(inputs[key]), "an existing file")
    with style.applied():
        figure = function(inputs, config)
        style.save(figure, out_path, small_run=bool(config.get("small_run", False)))
