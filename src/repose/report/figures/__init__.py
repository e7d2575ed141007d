"""Draw figures from the tables of the workflow, with published numbers if available."""

from pathlib import Path

from repose.common.errors import InputError

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
    """Draw a figure and write it to a file.

    Parameters
    ----------
    name : str
        Name of the figure in `known`.
    inputs : mapping
        Paths by name of the files that the figure shows.
    out_path : path
        File of the figure, which ends in .png, .pdf or .svg. Beside a PNG, the figure
        is also written in the other formats of the section `figures`.
    config : mapping
        The configuration of the study, or the sections that the figure reads.
    known : dict, optional
        Figures by name.

    Raises
    ------
    InputError
        If the name or the ending is unknown, or if an input is missing, unknown or not
        a file.
    """
    # These imports are slow, and the list of figures does not need them.
    from repose.config.models import FiguresSettings
    from repose.report.figures import style

    out_path = Path(out_path)
    style.check_ending(out_path)
    if name not in known:
        raise InputError("figures", key="name", value=name, allowed=", ".join(known))
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
    """Raise InputError if an input is missing, unknown or not a file.

    Parameters
    ----------
    name : str
        Name of the figure, for messages.
    figure_type : Drawn
        Entry of the figure in the list of figures.
    inputs : mapping
        Paths by name.
    """
    needed_keys = tuple(figure_type.inputs)
    allowed_keys = tuple(figure_type.all_inputs)
    source = f"figure {name}"
    for key in [*needed_keys, *inputs]:
        is_missing = key not in inputs
        is_unknown = key not in allowed_keys
        if is_missing or is_unknown:
            raise InputError(
                source,
                key="inputs",
                value=key,
                allowed=f"needs {needed_keys}, may have {allowed_keys}",
            )
        path = inputs[key]
        if not Path(path).is_file():
            raise InputError(
                source, key=key, value=str(path), allowed="an existing file"
            )
