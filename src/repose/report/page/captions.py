"""Captions of the pictures in a report, by the name of the picture."""

# Figures of a study with the simulator of this package.
STUDY_FIGURES = {
    "sequential": (
        "Probability and predictions of the best parameter set after each batch"
    ),
    "pareto_screening": "Effect of each parameter on the responses",
    "contours": "The fitted surfaces around their optimum",
    "intervals": (
        "Does the pile determine the parameters? The 95 % interval of each in its range. "
        "The thin lines span the sets found and the published ones; they are not "
        "uncertainties"
    ),
    "figure13": (
        "Does the surrogate predict samples that it has not seen, as well as their "
        "noise allows?"
    ),
    "plane": (
        "Can the simulated piles meet the targets, and does the answer? All samples, "
        "the target ranges, and the answer; beside them the target ranges enlarged"
    ),
    "profiles": "Measured profiles and the answer's, as predicted and as simulated",
    "figure14": "Where are the parameter sets found, and where are the published ones?",
    "validation": (
        "Do new simulations agree with the predictions, and lie inside the target ranges?"
    ),
    "outline": "The simulated pile and the measured numbers, drawn at one scale",
    "definitions": "How much does the angle depend on its definition?",
}

# Figures of the drum.
DRUM_FIGURES = {
    "figure15": "The bed before the rotation, before the first slip, and after the first slip",
    "drum": "When does the bed slip, and how deep? The angles in every run over time",
}

# Figures of a study with a simulator of the user's own.
OWN_SIMULATOR_FIGURES = {
    "plane": (
        "The simulated parameter sets, the target ranges, and the predicted answer"
    ),
    "history": "How far the simulated parameter sets of each batch are off the targets",
    "accuracy": "Does the surrogate predict samples that it has not learned from?",
    "intervals": "Intervals of the parameters in their ranges",
    "corner": "The posterior of the parameters, one by one and in pairs",
}

# Pictures of the pile, physical and simulated.
PILE_PICTURES = {
    "photograph": "The physical pile",
    "overlay": ("How the simulated pile was measured: its outline, height and angle"),
}
