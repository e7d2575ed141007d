# Steps of the strategy response_surface: inputs of its rules.
from repose.strategies.response_surface.steps import numbers

RESPONSE_SURFACE = f"{RESULTS}/response_surface"
# Analyses that write the samples of a step.
MAKERS = {
    "ascent": "response_screening",
    "surface": "response_ascent",
    "check": "response_surface_fit",
}


def response_surface_numbers(step):
    """Samples of a step: the screening's at once, the others' when the step before is analysed."""
    if step == "screening":
        section = config["response_surface"]
        return numbers(step, section["screening_runs"] + section["centres"])
    return pandas.read_csv(getattr(checkpoints, MAKERS[step]).get().output.samples)[
        "sample"
    ]
