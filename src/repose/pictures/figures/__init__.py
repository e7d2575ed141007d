"""Figures from the workflow's own tables, with the paper's numbers if the paper has a counterpart."""

from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from repose.core.errors import InputError

from . import style


def _drawn_by(module: str, name: str) -> Callable[[Mapping[str, Any], Mapping[str, Any]], Any]:
    """A function of a module of this package that is imported when it draws: each needs other slow libraries."""
    return lambda inputs, config: getattr(import_module(f".{module}", __name__), name)(inputs, config)


class Figure(NamedTuple):
    """The function that draws a figure, and its inputs by name."""

    draw: Callable[[Mapping[str, Any], Mapping[str, Any]], Any]
    needed: tuple[str, ...] = ()
    optional: tuple[str, ...] = ()


FIGURES = {
    "figure02": Figure(_drawn_by("berries", "sizes_and_sphericity"), ("sizes",)),
    "figure05": Figure(_drawn_by("testbench", "simulated_pile"), ("heap", "particle")),
    "figure06": Figure(_drawn_by("testbench", "measurement"), ("heap", "particle", "berry")),
    "figure07": Figure(_drawn_by("berries", "particle_and_mesh"), ("stl", "particle")),
    "figure08": Figure(_drawn_by("testbench", "apparatus"), (), ("trajectory", "particle")),
    "figure09": Figure(_drawn_by("workflow", "rule_graph"), ("dot",)),
    "figure10": Figure(_drawn_by("surrogate", "network_structure"), ("network",)),
    "figure13": Figure(
        _drawn_by("surrogate", "predicted_against_simulated"),
        ("predictions", "dataset"),
        ("fresh", "network"),
    ),
    "figure14": Figure(_drawn_by("search", "feasible_solutions"), ("feasible", "summary"), ("published",)),
    "figure15": Figure(_drawn_by("rotation", "states"), ("states", "particle"), ("runs",)),
    "definitions": Figure(_drawn_by("measuring", "definitions"), ("heap", "particle", "berry")),
    "drum": Figure(_drawn_by("rotation", "course"), ("record", "profile", "runs")),
    "convergence": Figure(_drawn_by("search", "convergence"), ("history",)),
    "plane": Figure(_drawn_by("plane", "planes"), ("dataset", "feasible", "table4"), ("pool", "fresh")),
    "profiles": Figure(_drawn_by("profiles", "profiles"), ("table4",)),
    "design": Figure(_drawn_by("samples", "design_matrix"), ("samples",), ("comparison",)),
    "dataset": Figure(_drawn_by("samples", "responses_over_parameters"), ("dataset",)),
    "validation": Figure(_drawn_by("checks", "validation"), ("table4",), ("published",)),
    "published": Figure(_drawn_by("checks", "published_solutions"), ("published",)),
    "noise": Figure(_drawn_by("uncertainty", "noise_floor"), ("runs", "seeds", "noise")),
    "corner": Figure(_drawn_by("uncertainty", "corner"), ("draws", "posterior", "summary", "feasible")),
    "intervals": Figure(_drawn_by("uncertainty", "intervals"), ("posterior",)),
    "discrepancy": Figure(_drawn_by("discrepancy", "over_the_discrepancy"), ("discrepancy",)),
    "region": Figure(_drawn_by("region", "not_excluded"), ("region", "summary")),
    "sobol": Figure(_drawn_by("uncertainty", "sobol_indices"), ("sobol",)),
    "approach": Figure(_drawn_by("refinement", "approach"), ("batches",), ("summary",)),
    "pareto_screening": Figure(_drawn_by("response_surface", "pareto"), ("effects",)),
    "pareto_surface": Figure(_drawn_by("response_surface", "pareto"), ("effects",)),
    "perturbation": Figure(_drawn_by("response_surface", "perturbation"), ("samples", "dataset")),
    "contours": Figure(_drawn_by("response_surface", "contours"), ("samples", "dataset", "optimum")),
    "sequential": Figure(_drawn_by("sequential", "sequential"), ("batches", "check")),
    "lifted_cylinder": Figure(_drawn_by("bench_scenes", "lifted_cylinder"), (), ("runs", "particle")),
    "inclined_plane": Figure(_drawn_by("bench_scenes", "inclined_plane")),
    "drop_test": Figure(_drawn_by("bench_scenes", "drop_test")),
    "drawdown": Figure(_drawn_by("bench_scenes", "drawdown"), (), ("runs", "particle")),
    "cylinder": Figure(_drawn_by("bench_scenes", "cylinder")),
    "discharge": Figure(_drawn_by("bench_scenes", "discharge")),
    "turning": Figure(_drawn_by("bench_scenes", "turning")),
    "main_effects": Figure(_drawn_by("uncertainty", "main_effects"), ("effects", "dataset", "sobol")),
}
ENDINGS = tuple(f".{kind}" for kind in style.UNDATED)


def draw(
    name: str,
    inputs: Mapping[str, Any],
    out_path: str | Path,
    config: Mapping[str, Any],
    known: Mapping[str, Figure] = FIGURES,
) -> None:
    """Draw a figure of `known` from `inputs`, paths by name; a PNG also gets the other formats of the configuration."""
    from repose.config.models import Figures

    out_path, files = Path(out_path), Figures.model_validate(config.get("figures", {}))
    if out_path.suffix not in ENDINGS:
        raise InputError(out_path, "ending", out_path.suffix, " or ".join(ENDINGS))
    if name not in known:
        raise InputError("figures", "name", name, ", ".join(known))
    drawn, allowed = known[name], known[name].needed + known[name].optional
    for key in [*drawn.needed, *inputs]:
        if key not in allowed or key not in inputs:
            raise InputError(f"figure {name}", "inputs", key, f"needs {drawn.needed}, may have {allowed}")
        if not Path(inputs[key]).is_file():
            raise InputError(f"figure {name}", key, str(inputs[key]), "an existing file")
    further = [kind for kind in files.format if kind != "png"] if out_path.suffix == ".png" else []
    with style.applied():
        figure = drawn.draw(inputs, config)
        style.name_the_line(figure, config)
        style.save(figure, out_path, bool(config.get("small_run", False)), further, files.dpi)
