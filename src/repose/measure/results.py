"""Results of a pile: of one picture, or of all views of a simulation."""

from dataclasses import dataclass

import numpy as np

from repose.measure.angles import DEFINITIONS, MEAN_KEYS, VIEW_KEYS


@dataclass(frozen=True)
class Angle:
    """Angles of a picture by one definition."""

    left_deg: float
    right_deg: float
    aor_deg: float  # of the pile
    lines: tuple  # (left, right), each ((column, row) below, (column, row) above)


@dataclass(frozen=True)
class Measurement:
    """Result of one picture."""

    response: str  # the definition used as the angle of repose
    angles: dict[str, Angle]  # by definition
    reasons: dict  # why the other definitions could not be measured
    height_mm: float  # of the highest point over the plate
    base_row: float  # row of the plate
    top: tuple  # (column, row) of the highest point
    contour: np.ndarray  # (M, 2), column and row of the boundary's pixels
    pile_is: str  # "darker" or "brighter" than the background

    @property
    def angle(self) -> Angle:
        """The angles by the response's definition."""
        return self.angles[self.response]

    @property
    def aor_deg(self) -> float:
        """The angle of repose."""
        return self.angle.aor_deg

    def record(self) -> dict[str, float | None]:
        """List the response's two sides, the Height and every definition by name, to 0.001; None if not measured."""
        sides = {
            key: round(getattr(self.angle, key), 3)
            for key in ("left_deg", "right_deg", "aor_deg")
        }
        angles: dict[str, float | None] = dict.fromkeys(MEAN_KEYS.values())
        angles |= {
            MEAN_KEYS[name]: round(angle.aor_deg, 3)
            for name, angle in self.angles.items()
        }
        return sides | {"height_mm": round(self.height_mm, 3)} | angles


@dataclass(frozen=True)
class PileResult:
    """Result of a simulated pile, seen from V sides."""

    response: str  # the definition used as the angle of repose
    height_mm: float  # exact, from the bodies themselves
    view_height_mm: np.ndarray  # (V,), of the silhouettes
    aor: dict  # degrees (V,) by definition, NaN if not measured
    reasons: dict  # by definition: the reason in the first view without it

    def mean_deg(self, name: str) -> float | None:
        """Mean of a definition over the views; None if it could not be measured in more than half of them."""
        seen = np.isfinite(self.aor[name])
        return (
            float(self.aor[name][seen].mean()) if 2 * seen.sum() >= seen.size else None
        )

    @property
    def aor_deg(self) -> float | None:
        """The angle of repose; None if the response could not be measured."""
        return self.mean_deg(self.response)

    def record(self) -> dict[str, float | None]:
        """All responses of the pile by name; None if not measured."""
        views = {VIEW_KEYS[name]: _or_none(self.aor[name][0]) for name in DEFINITIONS}
        means = {MEAN_KEYS[name]: self.mean_deg(name) for name in DEFINITIONS}
        heights = {
            "height_mm": self.height_mm,
            "height_view_mm": _or_none(self.view_height_mm[0]),
        }
        return {"aor_deg": self.aor_deg, **heights, **means, **views}


def _or_none(value: float) -> float | None:
    """Return a finite number, else None."""
    return float(value) if np.isfinite(value) else None
