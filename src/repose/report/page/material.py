"""Tabulate the values of material, contacts and simulation for another program."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from repose.common.numbers import format_significant
from repose.dem.materials import Material
from repose.report.page.tables import Table

# Number of digits of the calibrated contact parameters, and of the other values
CALIBRATED_DIGITS = 3
OTHER_DIGITS = 4
# The directions of a grain's principal axes, the longest first.
AXIS_NAMES = ("x", "y", "z")


class Value(NamedTuple):
    """A value to enter into another program."""

    name: str
    value: float
    unit: str = "–"
    digits: int = OTHER_DIGITS

    @property
    def text(self) -> str:
        """The rounded value, without an exponent if it is at least 1e-4 and below 1e6."""
        return f"{float(f'{self.value:.{self.digits}g}'):.6g}"


def tabulate_material(card: Mapping[str, Any]) -> Table:
    """Tabulate the values that another program needs, in SI units and rounded.

    Parameters
    ----------
    card : mapping
        The contents of the material card of a study that repose simulated.

    Returns
    -------
    Table
        A row for each quantity.
    """
    values = [
        *_list_grain_values(card["grain"]),
        *_list_wall_values(card["wall"]),
        *_list_contact_values(card["parameters"]),
        *_list_simulation_values(card.get("simulation", {})),
    ]
    rows = [[value.name, value.text, value.unit] for value in values]
    return Table(["quantity", "value", "unit"], rows, style="material")


def describe_size(grain: Mapping[str, Any]) -> str:
    """Describe whether the grains are equal in size; empty if the card does not say."""
    spread = grain.get("relative_spread")
    if spread is None:
        return ""
    if spread == 0:
        return "All grains are equal in size."
    return (
        f"The sizes of the grains scatter by {format_significant(100 * spread, 2)} %."
    )


def tabulate_laws(card: Mapping[str, Any]) -> Table:
    """Tabulate the contact laws by name."""
    rows = [[name, law] for name, law in card["laws"].items()]
    return Table(["law", "description"], rows, style="laws")


def _list_grain_values(grain: Mapping[str, Any]) -> Iterator[Value]:
    """Yield the density, elastic constants, size, mass and moments of a grain.

    Parameters
    ----------
    grain : mapping
        The section `grain` of the material card.

    Yields
    ------
    Value
        A value in SI units.
    """
    yield Value("grain: density", grain["density_kg_m3"], "kg/m³")
    yield Value("grain: Young's modulus", grain["elastic_modulus_pa"], "Pa")
    yield Value("grain: shear modulus", grain["shear_modulus_pa"], "Pa")
    yield Value("grain: Poisson's ratio", grain["poisson_ratio"])
    for axis, length_mm in zip(AXIS_NAMES, grain["mean_axes_mm"], strict=True):
        yield Value(f"grain: length along {axis}", 1e-3 * length_mm, "m")
    yield Value("grain: volume", 1e-9 * grain["volume_mm3"], "m³")
    yield Value("grain: mass", 1e-3 * grain["mass_g"], "kg")
    # Cards of earlier versions have no moments.
    for axis, moment in zip(AXIS_NAMES, grain.get("inertia_kg_m2", ()), strict=False):
        yield Value(f"grain: moment of inertia about {axis}", moment, "kg m²")


def _list_wall_values(wall: Mapping[str, Any]) -> Iterator[Value]:
    """Yield the elastic constants of the walls."""
    material = Material(wall["shear_modulus_pa"], wall["poisson_ratio"])
    yield Value("wall: Young's modulus", material.elastic_modulus_pa, "Pa")
    yield Value("wall: shear modulus", material.shear_modulus_pa, "Pa")
    yield Value("wall: Poisson's ratio", material.poisson_ratio)


def _list_contact_values(parameters: Mapping[str, Any]) -> Iterator[Value]:
    """Yield the contact parameters of the answer."""
    for name, parameter in parameters.items():
        # If a parameter has a unit, its meaning already includes the unit.
        yield Value(
            f"{parameter['meaning']} ({name})",
            parameter["value"],
            unit="",
            digits=CALIBRATED_DIGITS,
        )


def _list_simulation_values(simulation: Mapping[str, float]) -> Iterator[Value]:
    """Yield gravity and time step, which cards of earlier versions do not contain."""
    if simulation:
        yield Value("gravity, along -z", simulation["gravity_m_s2"], "m/s²")
        yield Value("time step", simulation["time_step_s"], "s")
