"""What is found on a pile: on one picture, or from all sides of a simulation."""

from dataclasses import dataclass

import numpy as np

from repose.measure.angles import DEFINITIONS, MEAN_KEYS, VIEW_KEYS


@dataclass(frozen=True)
class Angle:
    """One definition on one picture."""

    left_deg: float
    right_deg: float
    aor_deg: float
    lines: tuple


@dataclass(frozen=True)
class Measurement:
    """Result of one picture.

    `left_deg`, `right_deg`, `aor_deg` and `lines` are those of the definition `response`.
    """

    response: str
    angles: dict
    reasons: dict
    height_mm: float
    base_row: float
    top: tuple
    contour: np.ndarray
    pile_is: str

    @property
    def left_deg(self) -> float:
        """Angle of the left side by the response's definition."""
        return self.angles[self.response].left_deg

    @property
    def right_deg(self) -> float:
        """Angle of the right side by the response's definition."""
        return self.angles[self.response].right_deg

    @property
    def aor_deg(self) -> float:
        """The angle of repose."""
        return self.angles[self.response].aor_deg

    @property
    def lines(self) -> tuple:
        """Lines of both sides by the response's definition, see `Angle`."""
        return self.angles[self.response].lines

    def record(self) -> dict[str, float | None]:
        """The response's two sides and every definition, to 0.001."""
        sides = {key: round(getattr(self, key), 3) for key in ("left_deg", "right_deg", "aor_deg")}
        found = {
            MEAN_KEYS[name]: round(self.angles[name].aor_deg, 3) if name in self.angles else None
            for name in DEFINITIONS
        }
        return sides | {"height_mm": round(self.height_mm, 3)} | found


@dataclass(frozen=True)
class PileResult:
    """A simulated pile."""

    response: str
    height_mm: float
    view_height_mm: np.ndarray
    left: dict
    right: dict
    aor: dict
    reasons: dict

    def mean_deg(self, name: str) -> float | None:
        """Mean of a definition over the views."""
        seen = np.isfinite(self.aor[name])
        return float(self.aor[name][seen].mean()) if 2 * seen.sum() >= seen.size else None

    @property
    def aor_deg(self) -> float | None:
        """The angle of repose; None where the response could not be measured."""
        return self.mean_deg(self.response)

    @property
    def left_deg(self) -> np.ndarray:
        """Angles of the left side in each view by the response's definition, (V,)."""
        return self.left[self.response]

    @property
    def right_deg(self) -> np.ndarray:
        """Angles of the right side in each view by the response's definition, (V,)."""
        return self.right[self.response]

    def record(self) -> dict[str, float | None]:
        """All responses of the pile."""
        views = {VIEW_KEYS[name]: _or_none(self.aor[name][0]) for name in DEFINITIONS}
        means = {MEAN_KEYS[name]: self.mean_deg(name) for name in DEFINITIONS}
        heights = {"height_mm": self.height_mm, "height_view_mm": _or_none(self.view_height_mm[0])}
        return {"aor_deg": self.aor_deg, **heights, **means, **views}


def _or_none(value):
    """A number, or None for one that is not finite."""
    return float(value) if np.isfinite(value) else None
