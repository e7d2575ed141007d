"""Materials of a simulation by number, and the table of a force law's constants for each pair of them."""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

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


def pairs_of(contacts: Mapping[tuple[str, str], Contact], materials: Mapping[str, Material]) -> Pairs:
    """Contacts by pairs of names in both orders; ValueError for unknown names, no Contact, or two that differ."""
    if not isinstance(contacts, Mapping):
        raise ValueError(f"contacts is {contacts!r}; expected (material, material): Contact")
    both: Pairs = {}
    for pair, contact in contacts.items():
        named = isinstance(pair, tuple) and len(pair) == 2 and all(is_name(name) for name in pair)
        if not (named and isinstance(contact, Contact)):
            raise ValueError(f"contacts has {pair!r}: {contact!r}; expected (material, material): Contact")
        if not set(pair) <= set(materials):
            raise ValueError(f"contacts has {pair!r}; expected pairs of {', '.join(materials)}")
        if both.get(pair, contact) != contact:
            raise ValueError(f"contacts has {pair!r} in both orders; expected one of them, or the same for both")
        both[pair] = both[pair[::-1]] = contact
    return both


def number_materials(
    shapes: Mapping[str, Shape] | Mapping[str, Clump],
    of_walls: Iterable[str],
    materials: Mapping[str, Material],
    contacts: Pairs,
) -> MaterialNumbers:
    """Number the materials; ValueError for a missing material, or a missing contact of two that can meet."""
    names = list(dict.fromkeys(shape.material for shape in shapes.values()))
    of_bodies = {name: k for k, name in enumerate(names)}
    names += dict.fromkeys(name for name in of_walls if name not in names)
    for name in names:
        if name not in materials:
            raise ValueError(f"material is {name!r}; expected {', '.join(materials)}")
    for a in of_bodies:
        for b in names:
            if (a, b) not in contacts:
                raise ValueError(
                    f"contacts has no pair ({a!r}, {b!r}); every pair of materials that can meet needs one"
                )
    return MaterialNumbers(of_bodies, {name: k for k, name in enumerate(names)})


def check_constants(law: Law, numbers: MaterialNumbers, contacts: Pairs) -> None:
    """ValueError if a contact lacks a constant of the law, has one that the law does not need, or has a wrong value."""
    known = {constant.name: constant for constant in law.asks}
    for a in numbers.of_bodies:
        for b in numbers.of_all:
            given = contacts[a, b].constants
            for name in (*known, *given):
                if name not in known:
                    raise ValueError(
                        f"contacts of ({a!r}, {b!r}): {name} is no constant of contact_law {law.name!r}; "
                        f"expected {', '.join(known) or 'none'}"
                    )
                if name not in given:
                    raise ValueError(
                        f"contacts of ({a!r}, {b!r}): contact_law {law.name!r} needs constants[{name!r}], the "
                        f"{known[name].words} in {known[name].unit}"
                    )
                try:
                    known[name].check(given[name])
                except ValueError as fault:
                    raise ValueError(f"contacts of ({a!r}, {b!r}): {fault}") from None


def constants_of(
    law: Law, numbers: MaterialNumbers, materials: Mapping[str, Material], contacts: Pairs, tension: str
) -> np.ndarray:
    """Constants of a force law (K, K, n) for all pairs of K materials; 0 for two walls."""
    table = np.zeros((len(numbers.of_all), len(numbers.of_all), law.n_constants))
    for a, i in numbers.of_bodies.items():
        for b, j in numbers.of_all.items():
            table[i, j] = law.constants(materials[a], materials[b], contacts[a, b], tension)
            table[j, i] = table[i, j]
    return table


def fields_of_laws(
    contact_law: Law,
    rolling_law: Law,
    tension: str,
    friction_limit: str,
    numbers: MaterialNumbers,
    materials: Mapping[str, Material],
    contacts: Pairs,
) -> dict[str, Any]:
    """Fields of `repose.dem.kernels.state.Physics` that describe the force laws."""
    of_pairs = numbers, materials, contacts, tension
    return {
        "law": contact_law.make_options(tension, friction_limit),
        "rolling": rolling_law.make_options(tension, friction_limit),
        "law_constants": constants_of(contact_law, *of_pairs),
        "rolling_constants": constants_of(rolling_law, *of_pairs),
        "n_state": contact_law.n_state,
    }
