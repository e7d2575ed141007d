"""Results of a measured pile: of one picture, or of all views of a simulation."""

from dataclasses import dataclass

import numpy as np

from repose.measure.definitions import DEFINITIONS, MEAN_KEYS, VIEW_KEYS
from repose.measure.outline_shape import DOUBTFUL_VIEWS, MEASURED_VIEWS, sides_differ


@dataclass(frozen=True)
class Angle:
    """Angles of a picture by one definition."""

    left_deg: float
    right_deg: float
    aor_deg: float  # of the pile
    lines: tuple  # left and right, each of a lower and an upper end (column, row)


@dataclass(frozen=True)
class Measurement:
    """Result of one picture."""

    response: str  # the definition used as the angle of repose
    angles: dict[str, Angle]  # by definition
    reasons: dict  # why the other definitions could not be measured
    height_mm: float  # of the highest point over the plate; NaN without a scale
    base_row: float  # row of the plate
    top: tuple  # column and row of the highest point
    contour: np.ndarray  # (M, 2), column and row of the boundary's pixels
    is_darker: bool  # whether the pile is darker than the background

    @property
    def angle(self) -> Angle:
        """The angles by the response's definition."""
        return self.angles[self.response]

    @property
    def aor_deg(self) -> float:
        """The angle of repose."""
        return self.angle.aor_deg

    def record(self) -> dict[str, float | None]:
        """List the numbers of the picture by name, rounded to 0.001.

        These are the angles of both sides and of the pile by the response's definition,
        the height of the pile, and the angle of the pile by every definition. What
        could not be measured is None.
        """
        record: dict[str, float | None] = {
            "left_deg": round(self.angle.left_deg, 3),
            "right_deg": round(self.angle.right_deg, 3),
            "aor_deg": round(self.angle.aor_deg, 3),
            "height_mm": _finite_or_none(round(self.height_mm, 3)),
        }
        for definition, key in MEAN_KEYS.items():
            angle = self.angles.get(definition)
            record[key] = None if angle is None else round(angle.aor_deg, 3)
        return record


@dataclass(frozen=True)
class PileResult:
    """Result of a simulated pile, seen from V sides."""

    response: str  # the definition used as the angle of repose
    height_mm: float  # exact, from the bodies themselves
    view_height_mm: np.ndarray  # (V,), of the silhouettes
    aor: dict  # angles of repose (V,) [degrees] by definition, NaN if not measured
    sides_deg: np.ndarray  # (V, 2), left and right angle by the response's definition
    reasons: dict  # by definition: the reason in the first view without it

    def mean_deg(self, name: str) -> float | None:
        """Compute the mean angle of the pile by a definition, over the views.

        Views in which it could not be measured do not count. The result is None if
        these are more than half of the views.
        """
        angles = self.aor[name]
        is_measured = np.isfinite(angles)
        if 2 * is_measured.sum() < is_measured.size:
            return None
        return float(angles[is_measured].mean())

    @property
    def aor_deg(self) -> float | None:
        """The angle of repose; None if the response could not be measured."""
        return self.mean_deg(self.response)

    @property
    def n_measured_views(self) -> int:
        """Number of views in which the response could be measured."""
        return int(np.isfinite(self.aor[self.response]).sum())

    @property
    def n_doubtful_views(self) -> int:
        """Number of views whose two sides have very different angles.

        These views count in the means, as such photographs do.
        """
        left_deg, right_deg = self.sides_deg.T
        return int(sides_differ(left_deg, right_deg).sum())

    def record(self) -> dict[str, float | None]:
        """List all responses of the pile by name; None if not measured.

        These are the means over all views, and the values in the first view. The
        numbers of measured and of doubtful views follow.
        """
        record: dict[str, float | None] = {
            "aor_deg": self.aor_deg,
            "height_mm": self.height_mm,
            "height_view_mm": _finite_or_none(self.view_height_mm[0]),
        }
        for name in DEFINITIONS:
            record[MEAN_KEYS[name]] = self.mean_deg(name)
        for name in DEFINITIONS:
            record[VIEW_KEYS[name]] = _finite_or_none(self.aor[name][0])
        record[MEASURED_VIEWS] = self.n_measured_views
        record[DOUBTFUL_VIEWS] = self.n_doubtful_views
        return record


def _finite_or_none(value: float) -> float | None:
    """Return a finite number, else None."""
    return float(value) if np.isfinite(value) else None
