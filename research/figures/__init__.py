"""Figures of the studies here, drawn as those of the package."""

from research.figures import comparison, inversion

# Name of a figure: the function that draws it, and the inputs that it needs.
FIGURES = {
    "search": (inversion.searches, ("curves", "methods")),
    "whole": (inversion.whole, ("whole",)),
    "accuracy": (comparison.accuracy, ("accuracy",)),
    "surrogates": (comparison.surrogates, ("surrogates",)),
    "sampling": (comparison.sampling, ("sampling",)),
}
