"""Describe elastic materials, and the contact between two of them."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from .checks import check_not_negative, check_number, check_positive, is_name


@dataclass(frozen=True)
class Material:
    """An isotropic elastic material.

    Parameters
    ----------
    shear_modulus_pa : float
        G, above 0 [Pa].
    poisson_ratio : float
        nu, above -1, at most 0.5.

    Raises
    ------
    ValueError
        If a value is out of range. The message names it.
    """

    shear_modulus_pa: float
    poisson_ratio: float

    def __post_init__(self) -> None:
        """Check the values of the material."""
        check_positive("shear_modulus_pa", self.shear_modulus_pa)
        check_number(
            "poisson_ratio",
            self.poisson_ratio,
            allowed="above -1, at most 0.5",
            accepts=lambda nu: -1.0 < nu <= 0.5,
        )

    @property
    def elastic_modulus_pa(self) -> float:
        """Young's modulus E = 2 G (1 + nu) [Pa]."""
        return 2.0 * self.shear_modulus_pa * (1.0 + self.poisson_ratio)


@dataclass(frozen=True)
class Contact:
    """The parameters of a contact between two surfaces.

    Parameters
    ----------
    restitution : float
        Coefficient of restitution e, above 0, at most 1.
    static_friction : float
        Coefficient mu_s of Coulomb's limit, 0 or more.
    rolling_friction : float
        Coefficient mu_r of the rolling resistance, 0 or more.
    twisting_friction : float, optional
        Coefficient mu_t of the resistance against spin about the normal, 0 or more. The
        torque is at most mu_t times the normal force times the radius of the contact
        circle. The default is 3 pi / 16 mu_s, the value for a Hertz contact whose whole
        circle slides (Johnson 1985, section 7.2). Only laws that distinguish this spin
        from rolling use it.
    constants : mapping, optional
        Further constants that the contact law needs (`repose.dem.constants.OF_LAWS`),
        by name, such as ``{"surface_energy_j_m2": 0.05}`` for the law ``jkr``.

    Raises
    ------
    ValueError
        If a value is out of range. The message names it.
    """

    restitution: float
    static_friction: float
    rolling_friction: float
    twisting_friction: float | None = None
    constants: Mapping[str, float] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        """Check the values of the contact."""
        check_number(
            "restitution",
            self.restitution,
            allowed="above 0, at most 1",
            accepts=lambda e: 0.0 < e <= 1.0,
        )
        check_not_negative("static_friction", self.static_friction)
        check_not_negative("rolling_friction", self.rolling_friction)
        if self.twisting_friction is not None:
            check_not_negative("twisting_friction", self.twisting_friction)
        # Which constants are needed depends on the contact law, which is not known
        # here. Only the form of the names is checked.
        has_names = isinstance(self.constants, Mapping) and all(
            is_name(name) for name in self.constants
        )
        if not has_names:
            raise ValueError(f"constants is {self.constants!r}; expected name: number")


def effective_moduli(a: Material, b: Material) -> tuple[float, float]:
    """Compute the effective moduli E* and G* of a contact.

    Parameters
    ----------
    a, b : Material
        The two materials.

    Returns
    -------
    young, shear : float
        E* and G* [Pa], with 1/E* = sum (1 - nu^2)/E and 1/G* = sum (2 - nu)/G over the
        materials.
    """
    young = 1.0 / sum((1.0 - m.poisson_ratio**2) / m.elastic_modulus_pa for m in (a, b))
    shear = 1.0 / sum((2.0 - m.poisson_ratio) / m.shear_modulus_pa for m in (a, b))
    return young, shear
