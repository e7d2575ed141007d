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
    "outline": (
        "Does the simulated pile look like the measured one? The outlines of a simulated "
        "pile, over the measured height and slope at the same scale"
    ),
    "definitions": "How much does the angle depend on its definition?",
}

# Figures for the top of the page, beside the verdict. The page takes the first of them
# that the study has.
LEADING_FIGURES = ("outline", "plane")

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

# Notes that explain the columns of a table, by its title. Names of columns are those of
# the files, so a note explains each part of a name once.
_MEANS = (
    "A column such as aor_deg is a mean over the runs, and aor_se_deg is its standard "
    "error; the end of the name is the unit."
)
_SEARCH = (
    "Predicted columns come from the surrogate, without a simulation; objective is the "
    "sum of the differences from the targets, each in widths of its target range, and "
    "violation is how far the predictions lie outside these ranges."
)
TABLE_NOTES = {
    "Measured sizes": (
        "Each row is a dimension of the grain. n is the number of grains, and the last "
        "columns compare the measured sizes with the published ones."
    ),
    "Designs compared": (
        "A good design keeps its samples apart. min_distance is the smallest distance "
        "between two samples, as a fraction of the ranges; more is better. Of phi_p, "
        "which sums all inverse distances, and of centred_discrepancy, the unevenness "
        "of the samples, less is better."
    ),
    "Simulated samples": (
        "Each row is a parameter set of the design or of a batch. n_seeds is the number "
        f"of runs. {_MEANS} A name with view is measured from one side only."
    ),
    "Parameter sets found": (
        f"Each row is a parameter set that the search kept. {_SEARCH}"
    ),
    "Span of the sets found": (
        "low and high are the smallest and the largest value of a parameter in the sets "
        "found. dispersion_percent is their distance in percent of the searched range. "
        "The published columns give the same for the sets of the publication."
    ),
    "Sets simulated again": (
        "Each row is a parameter set that was simulated with new seeds. Optimism is by "
        "how much the prediction is expected to exceed the truth. error_percent is the "
        f"difference of predicted and simulated in percent of the simulated. {_MEANS}"
    ),
    "The drum: angles and first slip": (
        "Each row is a quantity of the drum: its mean over the runs with the standard "
        "error, and the lowest and highest value of a single run."
    ),
    "Starts of the network": (
        "The training starts several times from random weights. Each row is a start. "
        "log_evidence is the logarithm of the evidence by which the start is chosen. "
        "gamma is the number of well-determined weights, alpha and beta are the "
        "precisions of weights and of data, mse is the mean squared error on the scaled "
        "training samples, and decrement is the last decrease of the training error. "
        "at_cap tells whether training reached its limit of epochs."
    ),
    "Published sets in this simulator": (
        "Each row is a published parameter set, with its published and its simulated "
        f"pile. {_MEANS}"
    ),
    "The answer simulated again": (
        f"The row is the answer, with its prediction and its new simulations. {_MEANS}"
    ),
    "Batches": (
        "Each row is a batch of runs. pours is the number of runs so far, and why is the "
        "reason for the next batch. Where they are given, probability is that of meeting "
        "all targets with the best parameters so far, reachable is how high it may still "
        "become, and in_reach is the probability that any parameters meet all targets."
    ),
    "Analysis of variance of the surface": (
        "Each row is a term of the fitted surface or of its error. A term with a small p "
        "value affects the response more than the noise does."
    ),
}

# Pictures of the pile, physical and simulated.
PILE_PICTURES = {
    "photograph": "The physical pile",
    "overlay": ("How the simulated pile was measured: its outline, height and angle"),
}
