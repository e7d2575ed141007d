"""Describe a figure to the workflow, without loading the code that draws it.

`repose.report.figures.catalogue` lists the figures.
"""

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple

from repose.report.study_view import Config, StudyView

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from repose.config.pipeline import PipelineConfig

Inputs = Mapping[str, Any]  # paths by name

# An input of a figure is a path below the folder of results. Where the path depends on
# the study, it is one of these names in braces, which the workflow fills.
SIZES = "{config[berry][sizes]}"  # measured axes of the grains
ANSWER_SAMPLES = "{answer.dataset}"  # samples from which the answer was computed
ANSWER_SOLUTIONS = "{answer.feasible}"  # parameter sets that the search found
ANSWER_CHECK = "{answer.table4}"  # sets that were simulated again, with the answer
PUBLISHED_SOLUTIONS = "{published}"  # published sets, with what was published of them
SIMULATED_SETS = "{simulated}"  # the table validation.published_simulated
PUBLISHED_HERE = "{stored}"  # published sets, as simulated here
PUBLISHED_INTERVALS = "{table3}"  # published intervals of the parameters
POUR_TRAJECTORY = "{trajectory}"  # places of the grains over a pour of the answer

# Draws a figure from its inputs and the configuration of a study.
DrawFunction = Callable[[Inputs, Config], "Figure"]


def _every_study(study: "PipelineConfig") -> bool:
    """Return True, because every study has the figure."""
    return True


class Drawn(NamedTuple):
    """An entry of the list of figures.

    Attributes
    ----------
    function
        The function that draws the figure. A string names a module in this folder and
        its function, such as ``noise.draw_noise_floor``, which is called with the
        inputs and a `StudyView`. A callable is called with the inputs and the
        configuration.
    inputs
        Paths of the files that the figure needs, below the folder of results, by name.
    optional
        The same for files that some studies do not have.
    if_there
        The same for files that are shown if they exist, but never made for the figure.
    title
        Name of the figure in Snakemake's report.
    reads
        Sections or dotted keys of the configuration that the figure reads, besides
        `figures` and `small_run`.
    caption
        Caption of the figure. Names in braces are keys of the configuration.
    when
        Function that tells whether a study has the figure.
    folder, category
        Folder of the figure in the results, and its category in Snakemake's report.
    memory_mb
        Memory needed to draw the figure, with a margin.
    """

    function: str | DrawFunction
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
        """All inputs by name, including those that may be missing."""
        return {**self.inputs, **self.optional, **self.if_there}

    def draw(self, inputs: Inputs, config: Config) -> "Figure":
        """Draw the figure from the paths of its inputs and a configuration.

        The module that draws the figure is imported only here, because it loads large
        libraries.
        """
        if not isinstance(self.function, str):
            return self.function(inputs, config)
        module, _, name = self.function.partition(".")
        draw_study = getattr(import_module(f".{module}", __package__), name)
        figure: Figure = draw_study(inputs, StudyView(config))
        return figure

    def caption_of(self, config: Config) -> str:
        """Return the caption, with the names in braces replaced by values.

        The names are keys of the configuration, such as `{miga[rounds]}`. In addition,
        `{inputs}` and `{outputs}` are the numbers of parameters and of targets.
        """
        return self.caption.format(
            **config, inputs=len(config["parameters"]), outputs=len(config["targets"])
        )


def has_grain(study: "PipelineConfig") -> bool:
    """Return whether our simulator makes the runs, with the grain of the study."""
    return study.simulator is None


def has_pile(study: "PipelineConfig") -> bool:
    """Return whether the targets need piles of the funnel."""
    return "funnel" in study.targets.apparatus


def has_drum(study: "PipelineConfig") -> bool:
    """Return whether the study turns the answer in a drum."""
    return "drum" in study.config


def has_pairs(study: "PipelineConfig") -> bool:
    """Return whether at least two targets are numbers, which span a plane."""
    numbers = [target for target in study.targets if target.profile is None]
    return len(numbers) > 1


def has_profiles(study: "PipelineConfig") -> bool:
    """Return whether a target is a measured profile."""
    return bool(study.targets.profiles)


def has_network(study: "PipelineConfig") -> bool:
    """Return whether the surrogate is a neural network."""
    from repose.calibrate.surrogates import find_surrogate_class  # slow to import

    return find_surrogate_class(study.settings.surrogate).is_network
