"""Figures from the workflow's own tables, with the paper's numbers if the paper has a counterpart."""

from collections.abc import Mapping
from pathlib import Path

from repose.common.errors import InputError, require

from . import (  # noqa: F401  (registers the figures)
    berries,
    checks,
    discrepancy,
    measuring,
    plane,
    profiles,
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
)
from .registry import FIGURES, Config, Drawn, Inputs


def draw(
    name: str,
    inputs: Inputs,
    out_path: str | Path,
    config: Config,
    known: Mapping[str, Drawn] = FIGURES,
) -> None:
    """Draw a figure of `known` from `inputs`, paths by name; a PNG also gets the other formats of the configuration."""
    from repose.config.models import FiguresSettings

    out_path, files = (
        Path(out_path),
        FiguresSettings.model_validate(config.get("figures", {})),
    )
    style.check_ending(out_path)
    require(name in known, "figures", "name", name, ", ".join(known))
    needed, allowed = tuple(known[name].inputs), tuple(known[name].all_inputs)
    for key in [*needed, *inputs]:
        if key not in allowed or key not in inputs:
            raise InputError(
                f"figure {name}", "inputs", key, f"needs {needed}, may have {allowed}"
            )
        require(
            Path(inputs[key]).is_file(),
            f"figure {name}",
            key,
            str(inputs[key]),
            "an existing file",
        )
    further = (
        [kind for kind in files.format if kind != "png"]
        if out_path.suffix == ".png"
        else []
    )
    with style.applied():
        drawn = known[name].draw(inputs, config)
        style.explain_symbols(drawn, config)
        style.save(
            drawn, out_path, bool(config.get("small_run", False)), further, files.dpi
        )
