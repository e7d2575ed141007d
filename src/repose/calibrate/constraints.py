"""Constraints between parameters: linear inequalities such as ``mur_gg <= mus_gg``.

Each side is a parameter, or a number times a parameter: ``mur_gg <= 0.5 * mus_gg``.
"""

import math
import re
from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np

from repose.common.errors import did_you_mean

CONSTRAINT_FORM = (
    "two parameters with <= or >= between them, also with factors, such as"
)
CONSTRAINT_EXAMPLE = "mur_gg <= 0.5 * mus_gg"
EXPECTED_FORM = f"{CONSTRAINT_FORM} {CONSTRAINT_EXAMPLE!r}"
# The inequality signs. None of them may be part of another one, because `parse` looks
# for each of them in the text.
SIGNS = ("<=", ">=")
_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_PRODUCT = re.compile(rf"(?P<factor>{_NUMBER})\s*\*\s*(?P<name>.*\S)")


class Term(NamedTuple):
    """One side of a constraint: a factor times a parameter."""

    factor: float
    name: str


class Constraint(NamedTuple):
    """The inequality ``smaller <= larger`` between two terms.

    Attributes
    ----------
    text : str
        As the user wrote it.
    smaller, larger : Term
        The two sides of the inequality.
    """

    text: str
    smaller: Term
    larger: Term

    @classmethod
    def parse(cls, text: object, names: Sequence[str]) -> Self:
        """Parse the text of a constraint.

        Parameters
        ----------
        text : object
            Text such as ``mur_gg <= mus_gg`` or ``a >= 2 * b``.
        names : sequence of str
            Names of all parameters of the study.

        Returns
        -------
        Constraint

        Raises
        ------
        ValueError
            If the text is not a constraint. The message describes the expected form.
        """
        if not isinstance(text, str):
            raise ValueError(EXPECTED_FORM)
        # A constraint has exactly one inequality sign.
        signs = [sign for sign in SIGNS if sign in text]
        if len(signs) != 1 or text.count(signs[0]) != 1:
            raise ValueError(EXPECTED_FORM)
        (sign,) = signs
        left, right = (_parse_term(side, names) for side in text.split(sign))
        if left.name == right.name:
            raise ValueError(f"{EXPECTED_FORM}; both sides have {left.name}")
        if sign == "<=":
            return cls(text=text, smaller=left, larger=right)
        return cls(text=text, smaller=right, larger=left)

    def compute_excess(self, values: np.ndarray, names: Sequence[str]) -> np.ndarray:
        """Compute by how much the smaller side exceeds the larger one.

        Parameters
        ----------
        values : numpy.ndarray, (n, p)
            Parameter sets.
        names : sequence of str
            Names of the columns.

        Returns
        -------
        numpy.ndarray, (n,)
            Positive where the constraint is violated.
        """
        smaller = self.smaller.factor * values[:, names.index(self.smaller.name)]
        larger = self.larger.factor * values[:, names.index(self.larger.name)]
        return smaller - larger

    def compute_largest_excess(self, values: np.ndarray, names: Sequence[str]) -> float:
        """Compute an upper limit of the excess.

        `values` (1, p) are the largest absolute values of the parameters, and `names`
        are the names of their columns.
        """
        terms = (self.smaller, self.larger)
        sizes = [abs(term.factor) * values[0, names.index(term.name)] for term in terms]
        return float(sum(sizes))


def _parse_term(side: str, names: Sequence[str]) -> Term:
    """Parse one side of a constraint: a parameter, or a factor times a parameter.

    Parameters
    ----------
    side : str
        Text of the side, such as ``0.5 * mus_gg``.
    names : sequence of str
        Names of all parameters.

    Raises
    ------
    ValueError
        If it is neither. The message describes the expected form.
    """
    name = side.strip()
    # The name of a parameter may itself look like a product, as in ``2 * a``.
    if name in names:
        return Term(factor=1.0, name=name)
    factor = 1.0
    if product := _PRODUCT.fullmatch(name):
        name = product["name"]
        factor = float(product["factor"])
    if name not in names:
        hint = did_you_mean(name, names) or f"; parameters: {', '.join(names)}"
        raise ValueError(f"{EXPECTED_FORM}; {name!r} is not a parameter{hint}")
    if factor == 0 or not math.isfinite(factor):
        raise ValueError(f"{EXPECTED_FORM}, with factors that are not 0")
    return Term(factor=factor, name=name)
