"""Check the section `berry` of the configuration: the grain and its particle."""

from typing import Annotated, Literal

from pydantic import Field, ValidationInfo, field_validator

from repose.common.section import Allowed, OneOf, Path, PathOrNull, Section, refuse
from repose.grain.particle import KINDS, SURFACES

# These types apply to grains and walls, both here and in a card.
ShearModulus = Annotated[float, Field(ge=1.0e3, le=1.0e12)]
Density = Annotated[float, Field(ge=10, le=25000)]


class GrainSettings(Section):
    """Settings of the grain; config/README.md explains the keys."""

    sizes: Path = Field(
        description="CSV: `long_mm,major_mm,minor_mm`, full axes, a row per grain, at "
        "least 2 rows",
        json_schema_extra={"source": "2.1, Table 1 (reconstruction)"},
    )
    compression: PathOrNull = Field(
        description="CSV: "
        "`test,force_n,length_1_mm,length_2_mm,width_1_mm,width_2_mm,breadth_mm`, a "
        "row per test, `test` its label; not used, best null, if both moduli below are "
        "given",
        json_schema_extra={"source": "2.2 (reconstruction)"},
    )
    density_kg_m3: Density = Field(
        description="particle density",
        json_schema_extra={"source": "2.1, Table 2"},
    )
    poisson_ratio: Annotated[float, Field(ge=0, le=0.49)] | None = Field(
        description="Poisson's ratio; null: from the compression tests (Eq. 3)",
        json_schema_extra={"source": "Table 2"},
    )
    shear_modulus_pa: ShearModulus | None = Field(
        description="shear modulus; null: from the compression tests (Eq. 2, 4)",
        json_schema_extra={"source": "Table 2"},
    )
    stl: PathOrNull = Field(
        description="mesh of a grain, closed, in mm; null: one built from the mean "
        "axes and `mass_g`",
        json_schema_extra={"source": "3.1"},
    )
    mass_g: Annotated[float, Field(gt=0, le=1.0e6)] | None = Field(
        description="mean mass of a grain without `stl`: 42 to 78 % of the box around "
        "the axes; null: by `mean_size`",
        json_schema_extra={"source": "2.1: 1.25"},
    )
    particle: Annotated[str, OneOf(lambda: KINDS)] = Field(
        description="the body that stands for the grain in the simulation, made from "
        "the mesh",
        json_schema_extra={
            "source": "3.1 contradicts itself ([note E]"
            "(../docs/article.md#notes-what-is-missing-or-contradicts-itself))"
        },
    )
    spheres: Annotated[
        Literal["fewest"] | Annotated[int, Field(ge=1, le=64)],
        Allowed("fewest or an integer from 1 to 64"),
    ] = Field(
        description="largest number of spheres of a multisphere; `fewest`: as few as "
        "fit the mesh",
        json_schema_extra={"source": "open"},
    )
    surface: Annotated[str, OneOf(lambda: SURFACES)] = Field(
        description="surface of a multisphere",
        json_schema_extra={"source": "open"},
    )
    size_distribution: Literal["none", "measured"] = Field(
        description="`none`: all grains are alike; `measured`: each grain has its own "
        "scale",
    )
    # Results of versions without this key are of the mean axes; a new study takes the
    # value of method.yaml.
    mean_size: Literal["volume", "axes"] = Field(
        default="axes",
        description="the mean grain without `stl` and `mass_g`: `volume` scales the mean "
        "axes to the mean volume; `axes` keeps them",
        json_schema_extra={"source": "`axes`: 3.1"},
    )

    @property
    def keeps_volume(self) -> bool:
        """Whether the mean grain has the mean volume of the measured grains.

        With a scan or a mass, the volume follows from these instead.
        """
        return self.mean_size == "volume" and self.stl is None and self.mass_g is None

    @field_validator("poisson_ratio", "shear_modulus_pa")
    @classmethod
    def _require_measured(
        cls, value: float | None, info: ValidationInfo
    ) -> float | None:
        """Reject a missing modulus if there are no compression tests either."""
        # A path that failed its own check is not in `info.data`.
        compression = info.data.get("compression", "invalid")
        if value is None and compression is None:
            allowed = (
                "a number; or a table of compression tests in berry.compression, which "
                "gives both moduli"
            )
            refuse([("", allowed)])
        return value
