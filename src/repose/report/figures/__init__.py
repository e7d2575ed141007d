"""Draw figures from the tables of the workflow, with published numbers if there are."""

from pathlib import Path

from repose.common.errors import InputError, require

from .catalogue import FIGURES
from .registry import Config, Drawn, Inputs

__all__ = ["FIGURES", "Config", "Drawn", "Inputs", "draw"]


def draw(
    name: str,
    inputs: Inputs,
    out_path: str | Path,
    config: Config,
    known: dict[str, Drawn] = FIGURES,
) -> None:
    """Draw a figure and write it; a PNG also gets the other formats of the configuration.

    Parameters
    ----------
    name : str
        Name of the figure in `known`.
    inputs : mapping
        Paths of the files that it shows, by name.
    out_path : path
        File of the figure, which ends in .png, .pdf or .svg.
    config : mapping
        The configuration of the study, or the sections that the figure reads.
    known : dict, optional
        Figures by name.

    Raises
    ------
    InputError
        For an unknown name or ending, or an input that is missing, unknown or no file.
    """
    # slow to import, and not needed to read the list
    from repose.config.models import FiguresSettings
    from repose.report.figures import style

    out_path = Path(out_path)
    style.check_ending(out_path)
    require(name in known, "figures", "name", name, ", ".join(known))
    figure_type = known[name]
    _check_inputs(name, figure_type, inputs)

    settings = FiguresSettings.model_validate(config.get("figures", {}))
    other_formats = []
    if out_path.suffix == ".png":
        other_formats = [kind for kind in settings.format if kind != "png"]
    with style.applied():
        figure = figure_type.draw(inputs, config)
        style.explain_symbols(figure, config)
        style.save(
            figure,
            out_path,
            small_run=bool(config.get("small_run", False)),
            other_formats=other_formats,
            dpi=settings.dpi,
        )


def _check_inputs(name: str, figure_type: Drawn, inputs: Inputs) -> None:
    """Raise InputError for an input that is missing, unknown or no file.

    Parameters
    ----------
    name : str
        Name of the figure, for messages.
    figure_type : Drawn
        Its entry in the list of figures.
    inputs : mapping
        Paths by name.
    """
    needed = tuple(figure_type.inputs)
    allowed = tuple(figure_type.all_inputs)
    source = f"figure {name}"
    for key in [*needed, *inputs]:
        if key not in allowed or key not in inputs:
            expected = f"needs {needed}, may have {allowed}"
            raise InputError(source, "inputs", key, expected)
        if not Path(inputs[key]).is_file():
            raise InputError(source, key, str(inputs[key]), "an existing file")
