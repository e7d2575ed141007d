"""Draw the inside of a drum as the background of a picture of grains."""

import math
from dataclasses import dataclass

import numpy as np

DRUM_COLOUR = np.array([0.80, 0.82, 0.84])
DRUM_BRIGHTNESS = 1.1  # factor of the drum's colour
RIM_COLOUR = np.array([0.46, 0.50, 0.54])
MARK_COLOUR = np.array([0.16, 0.18, 0.20])
# Dark marks around the rim show how far the drum has turned.
N_MARKS = 12
MARK_HALF_WIDTH_RAD = 0.035
CIRCLE_POINTS = 72
# The rim begins at the inner radius, and at half the length from the middle. These
# limits are slightly smaller, so that points on the rim exceed them despite rounding
# errors.
RIM_RADIUS_FRACTION = 0.9999
RIM_LENGTH_FRACTION = 0.4999


@dataclass(frozen=True)
class DrumInside:
    """The inside of a drum about the y axis, seen along +y from a point on the axis.

    The drum is a cylinder, open towards the camera and closed at its far end.
    """

    radius_m: float  # inner
    length_m: float
    thickness_m: float
    turned_rad: float = 0.0  # angle about -y, which the marks on the rim show

    def compute_outline_points(self) -> np.ndarray:
        """Compute points (2 * CIRCLE_POINTS, 3) in m that enclose both rims."""
        angle = np.linspace(0.0, 2.0 * math.pi, CIRCLE_POINTS, endpoint=False)
        outer_radius = self.radius_m + self.thickness_m
        x = outer_radius * np.cos(angle)
        z = outer_radius * np.sin(angle)
        half_length = 0.5 * self.length_m
        rims = [
            np.column_stack([x, np.full(CIRCLE_POINTS, y), z])
            for y in (-half_length, half_length)
        ]
        return np.concatenate(rims)

    def find_intersections(
        self, eye_m: np.ndarray, rays: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Find where rays from a camera in front of the open end meet the drum.

        Parameters
        ----------
        eye_m : array (3,)
            Position of the camera.
        rays : array (H, W, 3)
            Directions of the rays, scaled to unit depth along the view.

        Returns
        -------
        depth : array (H, W)
            Depth in m; infinite for a ray that misses the drum.
        normals : array (H, W, 3)
            Unit normals at the points where the rays meet the drum. For a ray that
            misses the drum, the normal has no meaning.
        """
        # The open front end and the closed back end are planes perpendicular to the y
        # axis. A camera with a narrow view along y has no ray parallel to them.
        half_length = 0.5 * self.length_m
        front_depth = (-half_length - eye_m[1]) / rays[..., 1]
        back_depth = (half_length - eye_m[1]) / rays[..., 1]
        at_front = eye_m + front_depth[..., None] * rays
        radius_at_front = np.hypot(at_front[..., 0], at_front[..., 2])
        cylinder_depth = self._compute_cylinder_depth(eye_m, rays)

        # A ray that enters the drum ends at the inner cylinder or at the back. Other
        # rays end at the rim or miss the drum.
        enters_drum = radius_at_front < self.radius_m
        depth = np.where(
            enters_drum, np.minimum(cylinder_depth, back_depth), front_depth
        )

        # The inner cylinder faces the axis; the rim and the back face the camera. On
        # the cylinder, x and z of a point are as long as the radius.
        normals = np.zeros(rays.shape)
        on_cylinder = enters_drum & (cylinder_depth < back_depth)
        points_m = eye_m + depth[..., None] * rays
        normals[on_cylinder] = -points_m[on_cylinder] * (1.0, 0.0, 1.0) / self.radius_m
        normals[~on_cylinder] = 0.0, -1.0, 0.0

        meets_drum = radius_at_front <= self.radius_m + self.thickness_m
        return np.where(meets_drum, depth, np.inf), normals

    def _compute_cylinder_depth(
        self, eye_m: np.ndarray, rays: np.ndarray
    ) -> np.ndarray:
        """Compute the depth at which each ray leaves the infinite inner cylinder.

        Parameters
        ----------
        eye_m : array (3,)
            Position of the camera.
        rays : array (H, W, 3)
            Directions of the rays, scaled to unit depth.

        Returns
        -------
        array (H, W)
            Depth in m; infinite for a ray along the axis.
        """
        # A point eye + t * ray is on the cylinder where a t^2 + 2 b t + c = 0; the ray
        # leaves the cylinder at the larger root.
        a = rays[..., 0] ** 2 + rays[..., 2] ** 2
        b = rays[..., 0] * eye_m[0] + rays[..., 2] * eye_m[2]
        c = eye_m[0] ** 2 + eye_m[2] ** 2 - self.radius_m**2
        root = np.sqrt(np.maximum(b * b - a * c, 0.0))
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(a > 0.0, (-b + root) / a, np.inf)

    def compute_colours(
        self,
        points_m: np.ndarray,
        normals: np.ndarray,
        light_fraction: np.ndarray,
        sky_fraction: np.ndarray,
    ) -> np.ndarray:
        """Compute the colours of points on the drum.

        Parameters
        ----------
        points_m, normals : array (M, 3)
            The points in m, and the unit normals at these points.
        light_fraction, sky_fraction : array (M,)
            Fractions of the light and of the sky that reach the points.

        Returns
        -------
        array (M, 3)
            Red, green and blue, from 0 to 1 or slightly above.
        """
        # Shadows, gaps between grains, and surfaces that face down are darker. The
        # weights were chosen by eye. In each factor they add up to 1, so that a surface
        # in full light that faces up keeps its colour.
        brightness = (
            (0.62 + 0.38 * light_fraction)
            * (0.35 + 0.65 * sky_fraction)
            * (0.86 + 0.14 * normals[:, 2])
        )
        colour = DRUM_COLOUR * DRUM_BRIGHTNESS * brightness[:, None]

        # The rim is the ring around the open front end. The camera is at negative y.
        distance_from_axis = np.hypot(points_m[:, 0], points_m[:, 2])
        on_rim = distance_from_axis > RIM_RADIUS_FRACTION * self.radius_m
        on_rim &= points_m[:, 1] < -RIM_LENGTH_FRACTION * self.length_m
        colour[on_rim] = RIM_COLOUR

        # The marks turn with the drum.
        angle = np.arctan2(points_m[:, 2], points_m[:, 0]) - self.turned_rad
        colour[on_rim & _is_marked(angle)] = MARK_COLOUR
        return colour


def _is_marked(angle: np.ndarray) -> np.ndarray:
    """Tell which points on the rim have a mark.

    The mark at the bottom of a drum that has not turned is three times as wide.

    Parameters
    ----------
    angle : array (M,)
        Angles of the points in radians, from the drum's own x axis.

    Returns
    -------
    array (M,) of bool
        True for a point on a mark.
    """
    # The marks are at multiples of the spacing. Compute the angle from the nearest
    # mark, which is at most half a spacing.
    spacing = 2.0 * math.pi / N_MARKS
    to_nearest_mark = np.abs((angle + 0.5 * spacing) % spacing - 0.5 * spacing)
    # The bottom is at the angle -pi / 2. Compute the angle from it, which is at most
    # pi.
    to_bottom = np.abs((angle + 0.5 * math.pi + math.pi) % (2.0 * math.pi) - math.pi)
    on_mark = to_nearest_mark < MARK_HALF_WIDTH_RAD
    on_wide_mark = to_bottom < 3.0 * MARK_HALF_WIDTH_RAD
    return on_mark | on_wide_mark
