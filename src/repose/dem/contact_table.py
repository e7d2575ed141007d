"""Number the materials of a simulation, and tabulate a force law for their pairs."""

from collections.abc import Iterable, Mapping
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from .checks import is_name
from .laws.law import Law
from .materials import Contact, Material
from .shapes import Clump, Shape

PairContacts = dict[tuple[str, str], Contact]


class MaterialNumbers(NamedTuple):
    """Number of each material by its name.

    The materials of the bodies come first, then those of walls alone.
    """

    body_materials: dict[str, int]
    all_materials: dict[str, int]


def index_contacts(
    contacts: Mapping[tuple[str, str], Contact], materials: Mapping[str, Material]
) -> PairContacts:
    """Index contacts by pairs of material names, in both orders.

    Parameters
    ----------
    contacts : mapping
        The user's contacts, each by a pair of names in any order.
    materials : mapping
        The materials by name.

    Returns
    -------
    dict
        The contacts by (first name, second name) and by (second name, first name).

    Raises
    ------
    ValueError
        If a material is unknown, if a value is not a `Contact`, or if the two orders of
        a pair have different contacts.
    """
    if not isinstance(contacts, Mapping):
        raise ValueError(
            f"contacts is {contacts!r}; expected (material, material): Contact"
        )
    contact_of_pair: PairContacts = {}
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
        # The user may give a pair in both orders, but not with different contacts. If
        # the pair is new, it is compared with itself.
        if contact_of_pair.get(pair, contact) != contact:
            raise ValueError(
                f"contacts has {pair!r} in both orders; "
                "expected one of them, or the same for both"
            )
        contact_of_pair[pair] = contact
        # The reversed pair; for two equal names, it is the same key.
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
    contacts: PairContacts,
) -> MaterialNumbers:
    """Assign numbers to the materials of the bodies and walls.

    Parameters
    ----------
    shapes : mapping
        The shapes of the bodies by name.
    wall_materials : iterable of str
        Material of each wall.
    materials : mapping
        All materials by name.
    contacts : mapping
        The contacts by pairs of materials in both orders (`index_contacts`).

    Returns
    -------
    MaterialNumbers
        Numbers from 0, those of the bodies' materials first.

    Raises
    ------
    ValueError
        For a missing material, or a missing contact of two materials that can meet.
    """
    # A dictionary keeps each name once, in the order in which they first occur.
    body_names = list(dict.fromkeys(shape.material for shape in shapes.values()))
    all_names = list(dict.fromkeys([*body_names, *wall_materials]))
    for name in all_names:
        if name not in materials:
            raise ValueError(f"material is {name!r}; expected {', '.join(materials)}")
    # Bodies meet bodies and walls, but walls never meet each other.
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


def check_constants(law: Law, numbers: MaterialNumbers, contacts: PairContacts) -> None:
    """Raise ValueError unless each contact has exactly the constants of the law."""
    for pair in product(numbers.body_materials, numbers.all_materials):
        try:
            _check_constants_of_contact(law, contacts[pair].constants)
        except ValueError as error:
            raise ValueError(f"contacts of {pair}: {error}") from None


def _check_constants_of_contact(law: Law, values: Mapping[str, float]) -> None:
    """Check the constants that a user gave for one pair of materials.

    The law lists the constants that it needs in `law.asks`. All of these must be there,
    and no others.

    Parameters
    ----------
    law : Law
        The contact law, which lists the constants that it needs.
    values : mapping
        The user's values by the names of the constants.

    Raises
    ------
    ValueError
        If a constant is missing, out of bounds, or not needed by the law.
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
                f"{name} is not a constant of contact_law {law.name!r}; "
                f"expected {', '.join(law_names) or 'none'}"
            )


def tabulate_constants(
    law: Law,
    numbers: MaterialNumbers,
    materials: Mapping[str, Material],
    contacts: PairContacts,
    tension: str,
) -> np.ndarray:
    """Compute the constants of a force law for all pairs of materials.

    Parameters
    ----------
    law : Law
        The force law.
    numbers : MaterialNumbers
        Numbers of the materials.
    materials : mapping
        The materials by name.
    contacts : mapping
        The contacts by pairs of materials in both orders (`index_contacts`).
    tension : str
        How a contact ends; see `Simulation`.

    Returns
    -------
    ndarray (K, K, n)
        The n constants of each pair of the K materials. Those of the materials i and j
        are at both [i, j] and [j, i]. They are zero for two materials of walls, which
        never meet.
    """
    n_materials = len(numbers.all_materials)
    table = np.zeros((n_materials, n_materials, law.n_constants))
    for body, i in numbers.body_materials.items():
        for other, j in numbers.all_materials.items():
            constants = law.constants(
                materials[body], materials[other], contacts[body, other], tension
            )
            table[i, j] = constants
            table[j, i] = constants
    return table
