"""The section `berry` of the configuration: the measured grain, and the body that represents it."""

from typing import Annotated, Literal

from pydantic import Field, ValidationInfo, field_validator

from repose.common.section import OneOf, Path, PathOrNull, Section, refuse
from repose.grain.particle import KINDS, SURFACES


class GrainSettings(Section):
    """Settings of the grain; config/README.md explains the keys."""

    sizes: Path
    compression: PathOrNull
    density_kg_m3: float = Field(ge=10, le=25000)
    poisson_ratio: Annotated[float, Field(ge=0, le=0.49)] | None
    shear_modulus_pa: Annotated[float, Field(ge=1.0e3, le=1.0e12)] | None
    stl: PathOrNull
    mass_g: Annotated[float, Field(gt=0, le=1.0e6)] | None
    particle: Annotated[str, OneOf(lambda: KINDS)]
    spheres: Literal["fewest"] | Annotated[int, Field(ge=1, le=64)] = Field(
        description="fewest or an integer from 1 to 64"
    )
    surface: Annotated[str, OneOf(lambda: SURFACES)]
    size_distribution: Literal["none", "measured"]

    @field_validator("poisson_ratio", "shear_modulus_pa")
    @classmethod
    def _measured(cls, value: float | None, info: ValidationInfo) -> float | None:
        """Refuse a modulus that is missing if there are no compression tests either."""
        if value is None and info.data.get("compression", "invalid") is None:
            tests = "a table of compression tests in berry.compression, which gives both moduli"
            refuse([("", f"a number; or {tests}")])
        return value
