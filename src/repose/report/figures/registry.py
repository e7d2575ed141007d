"""Describe a figure to the workflow, without loading what draws it.

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
    """Tell that every study has the figure."""
    return True


class Drawn(NamedTuple):
    """An entry of the list of figures.

    Attributes
    ----------
    function
        What draws it. A text names a module of this folder and its function, such as
        ``noise.draw_noise_floor``. This function takes the inputs and a `StudyView`. A
        function itself takes the inputs and the configuration.
    inputs
        Files that it needs: name to path below the folder of results.
    optional
        Files that some studies lack.
    if_there
        Files that are shown if they exist, and are never made for the figure.
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
        """The inputs by name, with those that may be missing."""
        return {**self.inputs, **self.optional, **self.if_there}

    def draw(self, inputs: Inputs, config: Config) -> "Figure":
        """Draw the figure from its inputs, paths by name, and a configuration.

        The module that draws it is imported here, with the libraries that it needs.
        """
        if not isinstance(self.function, str):
            return self.function(inputs, config)
        module, _, name = self.function.partition(".")
        draw_study = getattr(import_module(f".{module}", __package__), name)
        figure: Figure = draw_study(inputs, StudyView(config))
        return figure

    def caption_of(self, config: Config) -> str:
        """Fill the names in braces of the caption.

        They are keys of the configuration, as `{miga[rounds]}`, and `{inputs}` and
        `{outputs}`, the numbers of parameters and targets.
        """
        return self.caption.format(
            **config, inputs=len(config["parameters"]), outputs=len(config["targets"])
        )


def has_grain(study: "PipelineConfig") -> bool:
    """Tell whether our simulator makes the runs, with the grain of the study."""
    return study.simulator is None


def has_pile(study: "PipelineConfig") -> bool:
    """Return whether the targets need piles of the funnel."""
    return "funnel" in study.targets.apparatus


def has_drum(study: "PipelineConfig") -> bool:
    """Return whether the study turns the answer in a drum."""
    return "drum" in study.config


def has_pairs(study: "PipelineConfig") -> bool:
    """Return whether two targets are numbers, which make a plane."""
    numbers = [target for target in study.targets if target.profile is None]
    return len(numbers) > 1


def has_profiles(study: "PipelineConfig") -> bool:
    """Return whether a target is a measured profile."""
    return bool(study.targets.profiles)


def has_network(study: "PipelineConfig") -> bool:
    """Return whether the surrogate is a neural network."""
    from repose.calibrate.surrogates import surrogate_class  # slow to import

    return surrogate_class(study.settings.surrogate).is_network
