"""Number the materials of a simulation, and tabulate a force law for their pairs."""

from collections.abc import Iterable, Mapping
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from .checks import is_name
from .laws.law import Law
from .materials import Contact, Material
from .shapes import Clump, Shape

Pairs = dict[tuple[str, str], Contact]


class MaterialNumbers(NamedTuple):
    """Number of each material by its name.

    The materials of the bodies come first, then those of walls alone.
    """

    body_materials: dict[str, int]
    all_materials: dict[str, int]


def pairs_of(
    contacts: Mapping[tuple[str, str], Contact], materials: Mapping[str, Material]
) -> Pairs:
    """Index contacts by pairs of material names, in both orders.

    Raises
    ------
    ValueError
        For an unknown material, a value that is no `Contact`, or different contacts for
        the two orders of a pair.
    """
    if not isinstance(contacts, Mapping):
        raise ValueError(
            f"contacts is {contacts!r}; expected (material, material): Contact"
        )
    contact_of_pair: Pairs = {}
    for pair, contact in contacts.items():
        if not (_is_pair_of_names(pair) and isinstance(contact, Contact)):
            raise ValueError(
                f"contacts has {pair!r}: {contact!r}; "
                "expected (material, material): Contact"
            )
        if not set(pair) <= set(materials):
            raise ValueError(
                f"contacts has {pair!r}; expected pairs of {', '.join(materials)}"
            )
        if contact_of_pair.get(pair, contact) != contact:
            raise ValueError(
                f"contacts has {pair!r} in both orders; "
                "expected one of them, or the same for both"
            )
        contact_of_pair[pair] = contact
        contact_of_pair[pair[::-1]] = contact
    return contact_of_pair


def _is_pair_of_names(pair: Any) -> bool:
    """Return whether a key is a tuple of two names."""
    if not (isinstance(pair, tuple) and len(pair) == 2):
        return False
    return all(is_name(name) for name in pair)


def number_materials(
    shapes: Mapping[str, Shape | Clump],
    wall_materials: Iterable[str],
    materials: Mapping[str, Material],
    contacts: Pairs,
) -> MaterialNumbers:
    """Give each material of the bodies and walls its number.

    Raises
    ------
    ValueError
        For a missing material, or a missing contact of two materials that can meet.
    """
    # A dictionary keeps each name once, in order.
    body_names = list(dict.fromkeys(shape.material for shape in shapes.values()))
    all_names = list(dict.fromkeys([*body_names, *wall_materials]))
    for name in all_names:
        if name not in materials:
            raise ValueError(f"material is {name!r}; expected {', '.join(materials)}")
    for a, b in product(body_names, all_names):
        if (a, b) not in contacts:
            raise ValueError(
                f"contacts has no pair ({a!r}, {b!r}); "
                "every pair of materials that can meet needs one"
            )
    return MaterialNumbers(
        body_materials={name: number for number, name in enumerate(body_names)},
        all_materials={name: number for number, name in enumerate(all_names)},
    )


def check_constants(law: Law, numbers: MaterialNumbers, contacts: Pairs) -> None:
    """Raise ValueError if a contact has not just the constants that the law needs."""
    for pair in product(numbers.body_materials, numbers.all_materials):
        try:
            _check_constants_of_contact(law, contacts[pair].constants)
        except ValueError as error:
            raise ValueError(f"contacts of {pair}: {error}") from None


def _check_constants_of_contact(law: Law, values: Mapping[str, float]) -> None:
    """Check the constants of one contact, given by their names.

    Raises
    ------
    ValueError
        For a constant that is missing, out of its bounds, or not one of the law.
    """
    for constant in law.asks:
        if constant.name not in values:
            raise ValueError(
                f"contact_law {law.name!r} needs constants[{constant.name!r}], "
                f"the {constant.words} in {constant.unit}"
            )
        constant.check(values[constant.name])
    law_names = [constant.name for constant in law.asks]
    for name in values:
        if name not in law_names:
            raise ValueError(
                f"{name} is no constant of contact_law {law.name!r}; "
                f"expected {', '.join(law_names) or 'none'}"
            )


def constants_of(
    law: Law,
    numbers: MaterialNumbers,
    materials: Mapping[str, Material],
    contacts: Pairs,
    tension: str,
) -> np.ndarray:
    """Compute the constants of a force law for all pairs of materials.

    Returns
    -------
    ndarray (K, K, n)
        The n constants for the materials with the numbers i and j, at [i, j] and at
        [j, i]. They are zero for two materials of walls, which never meet.
    """
    n_materials = len(numbers.all_materials)
    table = np.zeros((n_materials, n_materials, law.n_constants))
    for a, i in numbers.body_materials.items():
        for b, j in numbers.all_materials.items():
            values = law.constants(materials[a], materials[b], contacts[a, b], tension)
            table[i, j] = values
            table[j, i] = values
    return table
