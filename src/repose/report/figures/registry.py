"""The register of figures: said once, beside its function, are its inputs, the keys that it reads, and its caption."""

from collections.abc import Callable, Mapping
from functools import wraps
from inspect import cleandoc, unwrap
from typing import TYPE_CHECKING, Any, NamedTuple

from matplotlib.figure import Figure

from repose.report.shown import Config, Shown

if TYPE_CHECKING:
    from repose.config.pipeline import PipelineConfig

Inputs = Mapping[str, Any]  # paths by name
# The details of such a figure.
OF_POSTERIOR: dict[str, Any] = {
    "folder": "posterior",
    "category": "Uncertainty",
    "reads": ("parameters", "targets"),
}
PILE = {
    "heap": "validation/heaps/001.npz",
    "particle": "berry/particle.json",
}  # of the answer
MEASURED_PILE = PILE | {"berry": "berry/berry.json"}


Draw = Callable[
    [Inputs, Any], Figure
]  # takes a `Shown`; once it is registered, a configuration


class Drawn(NamedTuple):
    """A registered figure; its inputs are paths below the folder of results, or names in braces of the workflow."""

    draw: Draw
    inputs: Inputs
    optional: Mapping[str, str] = {}  # a study may lack them
    if_there: Mapping[
        str, str
    ] = {}  # shown where they exist, and never made for the figure
    title: str = ""  # in Snakemake's report
    reads: tuple[
        str, ...
    ] = ()  # sections or dotted keys of the configuration, besides `figures` and `small_run`
    caption: str = ""
    when: "Callable[[PipelineConfig], bool]" = lambda study: (
        True
    )  # whether a study has the figure
    folder: str = "figures"
    category: str = "Figures"

    @property
    def all_inputs(self) -> Mapping[str, str]:
        """The inputs by name, those that may lack included."""
        return {**self.inputs, **self.optional, **self.if_there}

    def caption_of(self, config: Config) -> str:
        """Fill the names in braces of the caption: keys of a configuration, as `{miga[rounds]}`, and two numbers."""
        return self.caption.format(
            **config, inputs=len(config["parameters"]), outputs=len(config["targets"])
        )


FIGURES: dict[str, Drawn] = {}


def figure(
    name: str, title: str, inputs: Inputs, caption: str = "", **details: Any
) -> Callable[[Draw], Draw]:
    """Register the decorated function as a figure; the last paragraph of its docstring is the caption by default.

    `details` are further fields of `Drawn`.
    """

    def register(draw: Draw) -> Draw:
        words = caption or cleandoc(draw.__doc__ or "").split("\n\n")[-1]

        @wraps(draw)
        def of_config(inputs: Inputs, config: Config) -> Figure:
            return unwrap(draw)(inputs, Shown(config))

        FIGURES[name] = Drawn(of_config, inputs, title=title, caption=words, **details)
        return of_config

    return register


def has_pile(study: "PipelineConfig") -> bool:
    """Tell whether the targets need piles of the funnel."""
    return "funnel" in study.targets.apparatus


def has_drum(study: "PipelineConfig") -> bool:
    """Tell whether the study turns the answer in a drum."""
    return "drum" in study.config
