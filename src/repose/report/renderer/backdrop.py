"""Background of a picture of grains: the inside of the drum."""

import math
from dataclasses import dataclass

import numpy as np

DRUM_TONE = np.array([0.80, 0.82, 0.84])
RIM_TONE = np.array([0.46, 0.50, 0.54])
MARK_TONE = np.array([0.16, 0.18, 0.20])
MARKS, MARK_RAD = 12, 0.035  # around the rim, and half as wide as this


@dataclass(frozen=True)
class DrumInside:
    """A cylinder about the y axis, open towards a camera that looks along +y on the axis, closed behind."""

    radius_m: float  # inner
    length_m: float
    thickness_m: float
    turned_rad: float = 0.0  # about -y; the marks on the rim show it

    def outline(self) -> np.ndarray:
        """Give points (144, 3) in m that a picture must contain: both rims."""
        angle = np.linspace(0.0, 2.0 * math.pi, 72, endpoint=False)
        outer, half = self.radius_m + self.thickness_m, 0.5 * self.length_m
        return np.concatenate(
            [
                np.column_stack(
                    [outer * np.cos(angle), np.full(72, y), outer * np.sin(angle)]
                )
                for y in (-half, half)
            ]
        )

    def meet(
        self, eye_m: np.ndarray, rays: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Give depth (H, W) [m] or infinity, and unit normal (H, W, 3) of the drum for rays (H, W, 3) of unit depth."""
        half = 0.5 * self.length_m
        front, back = ((y - eye_m[1]) / rays[..., 1] for y in (-half, half))
        mouth = np.hypot(*((eye_m + front[..., None] * rays)[..., k] for k in (0, 2)))
        a = rays[..., 0] ** 2 + rays[..., 2] ** 2
        b = rays[..., 0] * eye_m[0] + rays[..., 2] * eye_m[2]
        c = eye_m[0] ** 2 + eye_m[2] ** 2 - self.radius_m**2
        with np.errstate(divide="ignore", invalid="ignore"):
            shell = np.where(
                a > 0.0, (-b + np.sqrt(np.maximum(b * b - a * c, 0.0))) / a, np.inf
            )
        depth = np.where(mouth < self.radius_m, np.minimum(shell, back), front)
        point = eye_m + depth[..., None] * rays
        normal = np.zeros(rays.shape)
        on_shell = (mouth < self.radius_m) & (shell < back)
        normal[on_shell] = -point[on_shell] * (1.0, 0.0, 1.0) / self.radius_m
        normal[~on_shell] = 0.0, -1.0, 0.0
        return np.where(
            mouth <= self.radius_m + self.thickness_m, depth, np.inf
        ), normal

    def paint(
        self, place: np.ndarray, normal: np.ndarray, lit: np.ndarray, sky: np.ndarray
    ) -> np.ndarray:
        """Give colours (M, 3) of places on the drum: red, green and blue, 0 to 1 or a little above."""
        tone = (0.62 + 0.38 * lit) * (0.35 + 0.65 * sky) * (0.86 + 0.14 * normal[:, 2])
        colour = DRUM_TONE * 1.1 * tone[:, None]
        rim = np.hypot(place[:, 0], place[:, 2]) > 0.9999 * self.radius_m
        rim &= place[:, 1] < -0.4999 * self.length_m
        colour[rim] = RIM_TONE
        turn = np.arctan2(place[:, 2], place[:, 0]) - self.turned_rad
        spacing = 2.0 * math.pi / MARKS
        marked = np.abs((turn + 0.5 * spacing) % spacing - 0.5 * spacing) < MARK_RAD
        first = (
            np.abs((turn + 0.5 * math.pi + math.pi) % (2.0 * math.pi) - math.pi)
            < 3.0 * MARK_RAD
        )
        colour[rim & (marked | first)] = MARK_TONE
        return colour
