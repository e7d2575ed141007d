"""Figures from the workflow's own tables, with the paper's numbers if the paper has a counterpart."""

from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

from repose.core.errors import InputError

from . import style


def _drawn_by(module: str, name: str) -> Callable[[Mapping[str, Any], Mapping[str, Any]], Any]:
    """A function of a module of this package that is imported when it draws: each needs other slow libraries."""
    return lambda inputs, config: getattr(import_module(f".{module}", __name__), name)(inputs, config)


# Name of a figure: the function that draws it and the inputs it needs; inputs in OPTIONAL may be left out.
FIGURES = {
    "figure02": (_drawn_by("berries", "sizes_and_sphericity"), ("sizes",)),
    "figure05": (_drawn_by("testbench", "simulated_pile"), ("heap", "particle")),
    "figure06": (_drawn_by("testbench", "measurement"), ("heap", "particle", "berry")),
    "figure07": (_drawn_by("berries", "particle_and_mesh"), ("stl", "particle")),
    "figure08": (_drawn_by("testbench", "apparatus"), ()),
    "figure09": (_drawn_by("workflow", "rule_graph"), ("dot",)),
    "figure10": (_drawn_by("surrogate", "network_structure"), ("network",)),
    "figure13": (_drawn_by("surrogate", "predicted_against_simulated"), ("predictions", "dataset")),
    "figure14": (_drawn_by("search", "feasible_solutions"), ("feasible", "summary")),
    "figure15": (_drawn_by("rotation", "states"), ("states", "particle")),
    "definitions": (_drawn_by("measuring", "definitions"), ("heap", "particle", "berry")),
    "drum": (_drawn_by("rotation", "course"), ("record", "profile", "runs")),
    "convergence": (_drawn_by("search", "convergence"), ("history",)),
    "plane": (_drawn_by("plane", "planes"), ("dataset", "feasible", "table4")),
    "profiles": (_drawn_by("profiles", "profiles"), ("table4",)),
    "design": (_drawn_by("samples", "design_matrix"), ("samples",)),
    "dataset": (_drawn_by("samples", "responses_over_parameters"), ("dataset",)),
    "validation": (_drawn_by("checks", "validation"), ("table4",)),
    "published": (_drawn_by("checks", "published_solutions"), ("published",)),
    "noise": (_drawn_by("uncertainty", "noise_floor"), ("runs", "seeds", "noise")),
    "corner": (_drawn_by("uncertainty", "corner"), ("draws", "posterior", "summary", "feasible")),
    "intervals": (_drawn_by("uncertainty", "intervals"), ("posterior",)),
    "discrepancy": (_drawn_by("discrepancy", "over_the_discrepancy"), ("discrepancy",)),
    "region": (_drawn_by("region", "not_excluded"), ("region", "summary")),
    "sobol": (_drawn_by("uncertainty", "sobol_indices"), ("sobol",)),
    "approach": (_drawn_by("refinement", "approach"), ("batches",)),
    "pareto_screening": (_drawn_by("response_surface", "pareto"), ("effects",)),
    "pareto_surface": (_drawn_by("response_surface", "pareto"), ("effects",)),
    "perturbation": (_drawn_by("response_surface", "perturbation"), ("samples", "dataset")),
    "contours": (_drawn_by("response_surface", "contours"), ("samples", "dataset", "optimum")),
    "sequential": (_drawn_by("sequential", "sequential"), ("batches", "check")),
    "lifted_cylinder": (_drawn_by("bench_scenes", "lifted_cylinder"), ()),
    "inclined_plane": (_drawn_by("bench_scenes", "inclined_plane"), ()),
    "drop_test": (_drawn_by("bench_scenes", "drop_test"), ()),
    "drawdown": (_drawn_by("bench_scenes", "drawdown"), ()),
    "cylinder": (_drawn_by("bench_scenes", "cylinder"), ()),
    "discharge": (_drawn_by("bench_scenes", "discharge"), ()),
    "turning": (_drawn_by("bench_scenes", "turning"), ()),
    "main_effects": (_drawn_by("uncertainty", "main_effects"), ("effects", "dataset", "sobol")),
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
ENDINGS = tuple(f".{kind}" for kind in style.UNDATED)


def draw(
    name: str,
    inputs: Mapping[str, Any],
    out_path: str | Path,
    config: Mapping[str, Any],
    known: Mapping[str, Any] = FIGURES,
) -> None:
    """Draw a figure of `known` from `inputs`, paths by name; a PNG also gets the other formats of the configuration."""
    from repose.config.models import Figures

    out_path, files = Path(out_path), Figures.model_validate(config.get("figures", {}))
    if out_path.suffix not in ENDINGS:
        raise InputError(out_path, "ending", out_path.suffix, " or ".join(ENDINGS))
    if name not in known:
        raise InputError("figures", "name", name, ", ".join(known))
    function, needed = known[name]
    allowed = needed + OPTIONAL.get(name, ())
    for key in [*needed, *inputs]:
        if key not in allowed or key not in inputs:
            raise InputError(f"figure {name}", "inputs", key, f"needs {needed}, may have {allowed}")
        if not Path(inputs[key]).is_file():
            raise InputError(f"figure {name}", key, str(inputs[key]), "an existing file")
    further = [kind for kind in files.format if kind != "png"] if out_path.suffix == ".png" else []
    with style.applied():
        figure = function(inputs, config)
        style.save(figure, out_path, bool(config.get("small_run", False)), further, files.dpi)
