"""Materials of a simulation by number, and the table of a force law's constants for each pair of them."""

from collections.abc import Iterable, Mapping
from itertools import product
from typing import NamedTuple

import numpy as np

from .checks import is_name
from .laws.law import Law
from .materials import Contact, Material
from .shapes import Clump, Shape

Pairs = dict[tuple[str, str], Contact]


class MaterialNumbers(NamedTuple):
    """Number of each material by its name; the materials of bodies come first."""

    of_bodies: dict[str, int]
    of_all: dict[str, int]


def pairs_of(
    contacts: Mapping[tuple[str, str], Contact], materials: Mapping[str, Material]
) -> Pairs:
    """Contacts by pairs of names in both orders; ValueError for unknown names, no Contact, or two that differ."""
    if not isinstance(contacts, Mapping):
        raise ValueError(
            f"contacts is {contacts!r}; expected (material, material): Contact"
        )
    both: Pairs = {}
    for pair, contact in contacts.items():
        named = (
            isinstance(pair, tuple)
            and len(pair) == 2
            and all(is_name(name) for name in pair)
        )
        if not (named and isinstance(contact, Contact)):
            raise ValueError(
                f"contacts has {pair!r}: {contact!r}; expected (material, material): Contact"
            )
        if not set(pair) <= set(materials):
            raise ValueError(
                f"contacts has {pair!r}; expected pairs of {', '.join(materials)}"
            )
        if both.get(pair, contact) != contact:
            raise ValueError(
                f"contacts has {pair!r} in both orders; expected one of them, or the same for both"
            )
        both[pair] = both[pair[::-1]] = contact
    return both


def number_materials(
    shapes: Mapping[str, Shape | Clump],
    of_walls: Iterable[str],
    materials: Mapping[str, Material],
    contacts: Pairs,
) -> MaterialNumbers:
    """Give each material its number; ValueError for a missing material, or a missing contact of two that can meet."""
    names = list(dict.fromkeys(shape.material for shape in shapes.values()))
    of_bodies = {name: k for k, name in enumerate(names)}
    names += dict.fromkeys(name for name in of_walls if name not in names)
    for name in names:
        if name not in materials:
            raise ValueError(f"material is {name!r}; expected {', '.join(materials)}")
    for a, b in product(of_bodies, names):
        if (a, b) not in contacts:
            raise ValueError(
                f"contacts has no pair ({a!r}, {b!r}); every pair of materials that can meet needs one"
            )
    return MaterialNumbers(of_bodies, {name: k for k, name in enumerate(names)})


def check_constants(law: Law, numbers: MaterialNumbers, contacts: Pairs) -> None:
    """Raise ValueError if a contact lacks a constant of the law, has another one, or has a wrong value."""
    for pair in product(numbers.of_bodies, numbers.of_all):
        try:
            _check_constants_of(law, contacts[pair].constants)
        except ValueError as fault:
            raise ValueError(f"contacts of {pair}: {fault}") from None


def _check_constants_of(law: Law, given: Mapping[str, float]) -> None:
    """Check the constants of one contact."""
    known = {constant.name: constant for constant in law.asks}
    for name in (*known, *given):
        if name not in known:
            none = f"{name} is no constant of contact_law {law.name!r}"
            raise ValueError(f"{none}; expected {', '.join(known) or 'none'}")
        if name not in given:
            needs = f"contact_law {law.name!r} needs constants[{name!r}]"
            raise ValueError(f"{needs}, the {known[name].words} in {known[name].unit}")
        known[name].check(given[name])


def constants_of(
    law: Law,
    numbers: MaterialNumbers,
    materials: Mapping[str, Material],
    contacts: Pairs,
    tension: str,
) -> np.ndarray:
    """Constants of a force law (K, K, n) for all pairs of K materials; 0 for two walls."""
    table = np.zeros((len(numbers.of_all), len(numbers.of_all), law.n_constants))
    for a, i in numbers.of_bodies.items():
        for b, j in numbers.of_all.items():
            table[i, j] = law.constants(
                materials[a], materials[b], contacts[a, b], tension
            )
            table[j, i] = table[i, j]
    return table
