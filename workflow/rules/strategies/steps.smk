# Steps of the strategy response_surface: inputs of its rules.
from repose.strategies.response_surface.steps import STEPS, numbers

RESPONSE_SURFACE = f"{RESULTS}/response_surface"
# What the analysis of a step writes besides the samples of the next one.
FITTED = ("anova.csv", "effects.csv", "statistics.csv")
FOUND = {
    "screening": (*FITTED, "screening.json"),
    "ascent": ("path.csv",),
    "surface": (*FITTED, "predictions.csv", "optimum.json"),
}


def following(step):
    """The step after one."""
    return STEPS[STEPS.index(step) + 1]


def folders_until(step):
    """Folders of the steps up to one."""
    return [f"{RESPONSE_SURFACE}/{name}" for name in STEPS[: STEPS.index(step) + 1]]


def tables_until(step):
    """Tables of the steps up to one."""
    return expand(
        "{folder}/{table}.csv", folder=folders_until(step), table=("dataset", "runs")
    )


def response_surface_numbers(step):
    """Samples of a step: the screening's at once, the others' when the step before is analysed."""
    if step == "screening":
        section = config["response_surface"]
        return numbers(step, section["screening_runs"] + section["centres"])
    before = STEPS[STEPS.index(step) - 1]
    made = getattr(checkpoints, f"after_{before}").get().output.samples
    return pandas.read_csv(made)["sample"]
