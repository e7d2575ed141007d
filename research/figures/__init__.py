"""Figures of the studies here, drawn as those of the package."""

from research.figures import comparison, inversion, representations, second_look

# Name of a figure: the function that draws it, and the inputs that it needs.
FIGURES = {
    "search": (inversion.searches, ("curves", "methods")),
    "whole": (inversion.whole, ("whole",)),
    "shape_study": (representations.study, ("combinations", "sets")),
    "second_responses": (
        second_look.what_to_measure_next,
        ("responses", "information", "narrowing", "ways"),
    ),
    "accuracy": (comparison.accuracy, ("accuracy",)),
    "surrogates": (comparison.surrogates, ("surrogates",)),
    "sampling": (comparison.sampling, ("sampling",)),
}
