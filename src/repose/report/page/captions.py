"""Captions of the pictures in a report, by the name of the picture."""

# Figures of a study with the simulator of this package.
STUDY_FIGURES = {
    "sequential": (
        "Probability and predictions of the best parameter set after each batch"
    ),
    "pareto_screening": "Effect of each parameter on the responses",
    "contours": "The fitted surfaces about their optimum",
    "figure13": (
        "Predictions of the surrogate and results of the simulator, for training "
        "samples and others"
    ),
    "plane": "All simulated samples, the target ranges, and the answer",
    "profiles": "Measured profiles and the answer's, as predicted and as simulated",
    "figure14": "The parameter sets that the search found",
    "validation": "Predicted, simulated and measured responses",
    "definitions": "The definitions of the angle on the same pile",
}

# Figures of a study with a simulator of the user's own.
OWN_SIMULATOR_FIGURES = {
    "plane": (
        "The simulated parameter sets, the target ranges, and the answer as it is "
        "predicted"
    ),
    "history": "How far the simulated parameter sets of each batch are off the targets",
    "intervals": "Intervals of the parameters in their ranges",
    "corner": "The posterior of the parameters, one by one and in pairs",
}

# Pictures of the pile, physical and simulated.
PILE_PICTURES = {
    "photograph": "The physical pile",
    "overlay": ("How the simulated pile was measured: its outline, height and angle"),
}
