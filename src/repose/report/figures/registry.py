"""The register of figures: what a figure shows stands beside the function that draws it.

A new figure is a function with the decorator `figure` in a module that `__init__.py`
imports. The workflow makes its rule, its caption and its inputs from what is said there.
"""

from collections.abc import Callable, Mapping
from functools import wraps
from inspect import cleandoc, unwrap
from typing import TYPE_CHECKING, Any, NamedTuple

from matplotlib.figure import Figure

from repose.report.study_view import Config, StudyView

if TYPE_CHECKING:
    from repose.config.pipeline import PipelineConfig

Inputs = Mapping[str, Any]  # paths by name

# An input of a figure is a path below the folder of results. Where the path depends on
# the study, it is one of these names in braces, which the workflow fills.
SIZES = "{config[berry][sizes]}"  # measured axes of the grains
ANSWER_SAMPLES = "{answer.dataset}"  # samples from which the answer was computed
ANSWER_SOLUTIONS = "{answer.feasible}"  # parameter sets that the search found
ANSWER_CHECK = "{answer.table4}"  # sets that were simulated again, with the answer
PUBLISHED_SOLUTIONS = "{published}"  # published sets, with what was published of them
PUBLISHED_HERE = "{stored}"  # published sets, as simulated here
PUBLISHED_INTERVALS = "{table3}"  # published intervals of the parameters
DRUM_STATES = "{states}"  # places of the grains in the drum, first run
POUR_TRAJECTORY = "{trajectory}"  # places of the grains over a pour of the answer

# Inputs of several figures.
PILE = {
    "heap": "validation/heaps/001.npz",
    "particle": "berry/particle.json",
}  # a pile of the answer
MEASURED_PILE = PILE | {"berry": "berry/berry.json"}

# Draws a figure from its inputs and a study. Once registered, it takes the
# configuration of the study instead.
Draw = Callable[[Inputs, Any], Figure]


def _every_study(study: "PipelineConfig") -> bool:
    """Tell that every study has the figure."""
    return True


class Drawn(NamedTuple):
    """A registered figure.

    Attributes
    ----------
    draw
        Draws the figure from its inputs, paths by name, and a configuration.
    inputs
        Files that it needs: name to path below the folder of results.
    optional
        Files that some studies lack.
    if_there
        Files that are shown where they exist, and are never made for the figure.
    title
        Its name in Snakemake's report.
    reads
        Sections or dotted keys of the configuration that it reads, besides `figures`
        and `small_run`.
    caption
        Its caption; names in braces are keys of the configuration.
    when
        Whether a study has the figure.
    folder, category
        Its folder in the results, and its place in Snakemake's report.
    memory_mb
        What drawing it takes, with a margin.
    """

    draw: Draw
    inputs: Inputs
    optional: Mapping[str, str] = {}
    if_there: Mapping[str, str] = {}
    title: str = ""
    reads: tuple[str, ...] = ()
    caption: str = ""
    when: "Callable[[PipelineConfig], bool]" = _every_study
    folder: str = "figures"
    category: str = "Figures"
    memory_mb: int = 400

    @property
    def all_inputs(self) -> Mapping[str, str]:
        """The inputs by name, with those that may be missing."""
        return {**self.inputs, **self.optional, **self.if_there}

    def caption_of(self, config: Config) -> str:
        """Fill the names in braces of the caption.

        They are keys of the configuration, as `{miga[rounds]}`, and `{inputs}` and
        `{outputs}`, the numbers of parameters and targets.
        """
        return self.caption.format(
            **config, inputs=len(config["parameters"]), outputs=len(config["targets"])
        )


FIGURES: dict[str, Drawn] = {}


def figure(
    name: str, title: str, inputs: Inputs, caption: str = "", **details: Any
) -> Callable[[Draw], Draw]:
    """Register the decorated function as a figure.

    Parameters
    ----------
    name : str
        Name of the figure and of its file.
    title : str
        Its name in Snakemake's report.
    inputs : mapping
        Files that it needs: name to path below the folder of results.
    caption : str, optional
        Its caption; by default the last paragraph of the function's docstring.
    **details
        Further fields of `Drawn`.
    """

    def register(draw: Draw) -> Draw:
        # A function with two names has two decorators; the inner one wrapped it.
        draw_study = unwrap(draw)

        @wraps(draw)
        def draw_config(inputs: Inputs, config: Config) -> Figure:
            return draw_study(inputs, StudyView(config))

        last_paragraph = cleandoc(draw.__doc__ or "").split("\n\n")[-1]
        caption_in_docstring = " ".join(last_paragraph.split())
        FIGURES[name] = Drawn(
            draw_config,
            inputs,
            title=title,
            caption=caption or caption_in_docstring,
            **details,
        )
        return draw_config

    return register


def has_grain(study: "PipelineConfig") -> bool:
    """Tell whether our simulator makes the runs, with the grain of the study."""
    return study.simulator is None


def has_pile(study: "PipelineConfig") -> bool:
    """Return whether the targets need piles of the funnel."""
    return "funnel" in study.targets.apparatus


def has_drum(study: "PipelineConfig") -> bool:
    """Return whether the study turns the answer in a drum."""
    return "drum" in study.config
