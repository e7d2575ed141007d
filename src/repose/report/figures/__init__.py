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
        Name of the figure, a key of `known`.
    inputs : mapping
        Paths by name of the files that the figure shows.
    out_path : path
        File of the figure, which ends in .png, .pdf or .svg. If it is a PNG, files in
        the other formats of the section `figures` are written beside it.
    config : mapping
        The configuration of the study, or the sections that the figure reads. If its
        key `small_run` is true, the figure says that the run is only a trial.
    known : dict, optional
        The figures that can be drawn, by name.

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
    figure_entry = known[name]
    _check_inputs(name, figure_entry, inputs)

    settings = FiguresSettings.model_validate(config.get("figures", {}))
    other_formats = []
    if out_path.suffix == ".png":
        other_formats = [ending for ending in settings.format if ending != "png"]
    with style.applied():
        figure = figure_entry.draw(inputs, config)
        # This reads all texts of the figure, so it must come last.
        style.explain_symbols(figure, config)
        style.save(
            figure,
            out_path,
            small_run=bool(config.get("small_run", False)),
            other_formats=other_formats,
            dpi=settings.dpi,
        )


def _check_inputs(name: str, figure_entry: Drawn, inputs: Inputs) -> None:
    """Raise InputError if an input is missing, unknown or not a file.

    Parameters
    ----------
    name : str
        Name of the figure, for messages.
    figure_entry : Drawn
        Entry of the figure in the list of figures.
    inputs : mapping
        Paths by name.
    """
    source = f"figure {name}"
    known_keys = list(figure_entry.all_inputs)
    optional_keys = [key for key in known_keys if key not in figure_entry.inputs]
    missing_keys = [key for key in figure_entry.inputs if key not in inputs]
    unknown_keys = [key for key in inputs if key not in known_keys]
    wrong_keys = [*missing_keys, *unknown_keys]
    if wrong_keys:
        allowed = f"all of: {', '.join(figure_entry.inputs) or 'none'}"
        if optional_keys:
            allowed += f"; and any of: {', '.join(optional_keys)}"
        raise InputError(source, key="inputs", value=wrong_keys[0], allowed=allowed)
    for key, path in inputs.items():
        if not Path(path).is_file():
            raise InputError(
                source, key=key, value=str(path), allowed="an existing file"
            )
