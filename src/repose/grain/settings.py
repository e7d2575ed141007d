"""The section `berry` of the configuration: the measured grain and its particle."""

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
    mean_size: Literal["volume", "axes"]

    @property
    def keeps_volume(self) -> bool:
        """Whether the mean grain has the mean volume of the measured grains.

        A scan or a mass gives another volume.
        """
        return self.mean_size == "volume" and self.stl is None and self.mass_g is None

    @field_validator("poisson_ratio", "shear_modulus_pa")
    @classmethod
    def _require_measured(
        cls, value: float | None, info: ValidationInfo
    ) -> float | None:
        """Refuse a missing modulus if there are no compression tests either."""
        # A path that failed its own check is not in `info.data`.
        compression = info.data.get("compression", "invalid")
        if value is None and compression is None:
            allowed = (
                "a number; or a table of compression tests in berry.compression, which "
                "gives both moduli"
            )
            refuse([("", allowed)])
        return value
