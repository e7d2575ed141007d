"""Colour a picture of grains, with light, shadows, open sky, plate and glass walls."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.ndimage import maximum_filter

from repose.report.renderer import raster
from repose.report.renderer.backdrop import DrumInside
from repose.report.renderer.bodies import Bodies
from repose.report.renderer.scenery import Camera, Frustum, Setting
from repose.report.renderer.view import View, compute_view

BACKGROUND_COLOUR = np.array([0.975, 0.977, 0.980])
PLATE_COLOUR = np.array([0.835, 0.842, 0.850])
FUNNEL_COLOUR = np.array([0.40, 0.50, 0.58])
GRAIN_COLOUR = "#cca86b"  # default colour of the first shape
# Colours of the second shape and of further ones.
OTHER_SHAPE_COLOURS = np.array(
    [[0.30, 0.42, 0.56], [0.45, 0.52, 0.26], [0.76, 0.125, 0.045]]
)
PANEL_FRACTION = 0.93  # of the plate's brightness
UP = np.array([0.0, 0.0, 1.0])
# Direction towards the light, a unit vector: its components to the right of the camera,
# ahead of it, and up. The light is above and behind the camera.
LIGHT_DIRECTION = np.array([0.42, -0.38, 0.82]) / np.linalg.norm([0.42, -0.38, 0.82])
# If the level component of the viewing direction is smaller, the view counts as
# vertical, and no direction is ahead.
SMALLEST_LEVEL_PART = 1e-9
LIGHT_PIXELS = 1400  # along the longer side of the depth map seen from the light
# Lengths as multiples of the largest body's radius: radius of the soft edge of a
# shadow, distance at which a surface begins to cast a shadow, and distance within which
# neighbours hide the sky
SOFTNESS_FRACTION = 0.35
BIAS_FRACTION = 0.03
SKY_REACH_FRACTION = 1.3
# Numbers of samples around a visible point: on the depth map of the light, and in the
# picture
LIGHT_TAPS = 24
SKY_TAPS = 20
RIM_WIDTH_M = 0.0012  # of the ends of a frustum


class Band(NamedTuple):
    """Some rows of a picture: R rows of W pixels."""

    image: np.ndarray  # (R, W, 3), to be painted
    view: View
    rays: np.ndarray  # (R, W, 3)
    lit: np.ndarray  # (R, W), fractions of the light
    sky: np.ndarray  # (R, W), fractions of the sky

    def places(self, camera: Camera, mask: np.ndarray) -> np.ndarray:
        """Return the points (M, 3) in m of the world that the pixels of a mask show."""
        return camera.eye_m + self.view.depth[mask][:, None] * self.rays[mask]

    def tone(self, mask: np.ndarray) -> np.ndarray:
        """Return the brightness (M,) of a dull surface in the pixels of a mask."""
        return (0.52 + 0.48 * self.lit[mask]) * (0.35 + 0.65 * self.sky[mask])


class LightMap(NamedTuple):
    """A depth map seen from the light."""

    heights: np.ndarray  # (rows, columns), largest height towards the light in m
    origin: np.ndarray  # (2,), corner of the map in m across the light
    pixel_m: float  # side of a pixel


class ConeSide(NamedTuple):
    """Where rays meet the far or near side of the endless cone of a frustum."""

    wall: Frustum
    distance: np.ndarray  # (H, W), along each ray
    is_met: np.ndarray  # (H, W), whether the ray meets the cone


def choose_tints(
    body_of_part: np.ndarray,
    shape_of_part: np.ndarray,
    n_bodies: int,
    n_shapes: int,
    colour: str = GRAIN_COLOUR,
) -> np.ndarray:
    """Choose the colours of the parts of bodies, slightly different for each body.

    Parameters
    ----------
    body_of_part, shape_of_part : array (N,) of int
        For each part, the number of its body and the number of its shape.
    n_bodies, n_shapes : int
        Number of bodies, and number of shapes.
    colour : str
        Colour of the first shape, as #rrggbb.

    Returns
    -------
    array (N, 3)
        Red, green and blue, from about 0 to about 1.
    """
    first_colour = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    # If there are more shapes than colours, repeat the colours.
    other_colours = [
        OTHER_SHAPE_COLOURS[k % len(OTHER_SHAPE_COLOURS)] for k in range(n_shapes - 1)
    ]
    colour_of_shape = np.array([first_colour, *other_colours])
    # Make each body lighter or darker, and more or less yellow, by random numbers with
    # a fixed seed. The factors were chosen by eye.
    ripeness, shade = np.random.RandomState(2026).uniform(-1, 1, (2, n_bodies))
    brightness = 1 + 0.16 * shade[body_of_part, None]
    yellow = np.array([0.045, 0.050, 0.004]) * ripeness[body_of_part, None]
    return colour_of_shape[shape_of_part] * brightness + yellow


def paint_picture(
    camera: Camera,
    bodies: Bodies,
    tints: np.ndarray,
    frame: np.ndarray,
    setting: Setting,
    supersample: int,
) -> np.ndarray:
    """Paint the picture that a camera takes of bodies.

    Parameters
    ----------
    camera : Camera
        The camera. Each of its pixels is a ray, and a pixel of the picture averages
        `supersample` rays along each side.
    bodies : Bodies
        The bodies.
    tints : array (N, 3)
        Colours of the bodies.
    frame : array (M, 3)
        Points in m. The plate fades out away from them.
    setting : Setting
        Walls, plate and backdrop.
    supersample : int
        Number of rays along each side of a pixel.

    Returns
    -------
    array (H / supersample, W / supersample, 3) of uint8
        Red, green and blue.
    """
    view = compute_view(camera, bodies, setting)
    lit, sky = _compute_light_and_sky(camera, bodies, view)
    height = camera.height // supersample
    width = camera.width // supersample
    picture = np.empty((height, width, 3), np.uint8)
    order = _sort_far_to_near(setting.frusta, camera)
    # Paint the picture in bands of rows, which saves memory. Paint the opaque surfaces
    # first, and then blend the glass walls over them.
    for rows in camera.bands(supersample):
        rays = camera.rays(rows)
        image = np.broadcast_to(BACKGROUND_COLOUR, rays.shape).copy()
        band = Band(image, view.rows(rows), rays=rays, lit=lit[rows], sky=sky[rows])
        _paint_plate(band, camera, frame)
        _paint_backdrop(band, camera, setting.backdrop)
        _paint_panels(band)
        _paint_bodies(band, camera, tints)
        _blend_walls(band, camera, walls=setting.frusta, order=order)
        # The colour of a pixel is the mean of its rays.
        ray_colours = np.clip(image, 0, 1)
        ray_colours = ray_colours.reshape(-1, supersample, width, supersample, 3)
        pixels = np.round(255 * ray_colours.mean(axis=(1, 3)))
        first_row = rows.start // supersample
        picture[first_row : first_row + len(pixels)] = pixels
    return picture


# --- Light ----------------------------------------------------------------------------


def _compute_light_and_sky(
    camera: Camera, bodies: Bodies, view: View
) -> tuple[np.ndarray, np.ndarray]:
    """Compute the fractions of the light and of the sky that reach each pixel.

    Parameters
    ----------
    camera : Camera
        The camera.
    bodies : Bodies
        The bodies.
    view : View
        What each pixel shows.

    Returns
    -------
    lit, sky : array (H, W)
        The fractions; both are 1 in a pixel that shows nothing.
    """
    if not len(bodies.vertices):
        lit, sky = np.ones((2, *view.depth.shape), np.float32)
        return lit, sky
    # Pass the camera in the form that the compiled loops expect.
    kernel_camera = (camera.eye_m, camera.axes, float(camera.focal_px))
    light_axes = _compute_light_axes(camera)
    light_map = _draw_light_map(bodies, light_axes)
    lit = raster.compute_lit_fraction(
        view.depth,
        view.normal,
        kernel_camera,
        light_map.heights,
        light_axes,
        light_map.origin,
        light_map.pixel_m,
        SOFTNESS_FRACTION * bodies.largest_m,
        BIAS_FRACTION * bodies.largest_m,
        LIGHT_TAPS,
    )
    # Surfaces far from all bodies see the whole sky, so sample only the pixels near a
    # body. Convert the reach to pixels at the nearest body, where it covers the most
    # pixels.
    reach_m = SKY_REACH_FRACTION * bodies.largest_m
    nearest_m = view.depth[view.hit].min(initial=np.inf)
    reach_px = math.ceil(reach_m * camera.focal_px / nearest_m)
    is_near_body = maximum_filter(view.hit, size=2 * reach_px + 1)
    sky = raster.compute_openness(
        view.depth, view.normal, kernel_camera, is_near_body, reach_m, SKY_TAPS
    )
    return lit, sky


def _compute_light_direction(camera: Camera) -> np.ndarray:
    """Compute the direction towards the light, which turns with the camera.

    Parameters
    ----------
    camera : Camera
        The camera.

    Returns
    -------
    array (3,)
        Unit vector in the world.
    """
    # The rows of the camera's axes point to its right, to the top of its picture, and
    # forward.
    right, top_of_picture, forward = camera.axes
    level_forward = forward * (1.0, 1.0, 0.0)
    length = np.linalg.norm(level_forward)
    if length > SMALLEST_LEVEL_PART:
        ahead = level_forward / length
    else:
        # If the camera looks straight down, the top of its picture counts as ahead.
        ahead = top_of_picture
    part_right, part_ahead, part_up = LIGHT_DIRECTION
    return part_right * right + part_ahead * ahead + part_up * UP


def _compute_light_axes(camera: Camera) -> np.ndarray:
    """Compute the axes of a picture that is seen from the light.

    Parameters
    ----------
    camera : Camera
        The camera, which determines the direction of the light.

    Returns
    -------
    array (3, 3)
        Rows: two unit vectors across the light, of which the first is level, and the
        unit vector towards the light. They are perpendicular to each other.
    """
    towards_light = _compute_light_direction(camera)
    across = np.cross(UP, towards_light)
    across /= np.linalg.norm(across)
    second_across = np.cross(towards_light, across)
    return np.stack([across, second_across, towards_light])


def _draw_light_map(bodies: Bodies, axes: np.ndarray) -> LightMap:
    """Draw the depth map of the bodies as seen from the light.

    Parameters
    ----------
    bodies : Bodies
        The bodies, at least one.
    axes : array (3, 3)
        Axes of the light, from `_compute_light_axes`.

    Returns
    -------
    LightMap
        The depth map.
    """
    points = bodies.vertices @ axes.T
    corner = points[..., :2].min(axis=(0, 1))
    extent = points[..., :2].max(axis=(0, 1)) - corner
    pixel_m = float(extent.max() / LIGHT_PIXELS)
    x = (points[..., 0] - corner[0]) / pixel_m
    y = (points[..., 1] - corner[1]) / pixel_m
    # Add a margin of one pixel beyond the last row and column that contain a point.
    shape = (int(y.max()) + 2, int(x.max()) + 2)
    # The rows of the map are counted upwards, unlike those of a picture. Reverse the
    # corners of the triangles, so that those that face the light are still drawn.
    clockwise = bodies.triangles[:, ::-1]
    heights, *_ = raster.draw_triangles(
        x, y, near=points[..., 2], triangles=clockwise, shape=shape
    )
    return LightMap(heights, corner, pixel_m)


# --- Opaque surfaces ------------------------------------------------------------------


def _paint_bodies(band: Band, camera: Camera, tints: np.ndarray) -> None:
    """Paint bodies by Lambert's law, with waxy highlights and sky light at their edges.

    The colour is a sum of several kinds of light. Their weights were chosen by eye.

    Parameters
    ----------
    band : Band
        Rows of the picture, whose pixels are written to.
    camera : Camera
        The camera.
    tints : array (N, 3)
        Colours of the bodies.
    """
    hit = band.view.hit
    towards_light = _compute_light_direction(camera)
    colour = np.clip(tints[band.view.body[hit]], 0, 1)
    normal = band.view.normal[hit]
    lit = band.lit[hit]
    sky = band.sky[hit]
    rays = band.rays[hit]
    sight = rays / np.linalg.norm(rays, axis=1, keepdims=True)

    # Lambert's law: the brightness is proportional to the cosine of the angle to the
    # light.
    diffuse = np.clip(normal @ towards_light, 0, 1) * lit
    # Blinn's highlights: a point is bright if its normal is halfway between the
    # directions to the light and to the viewer.
    halfway = towards_light - sight
    halfway /= np.linalg.norm(halfway, axis=1, keepdims=True)
    shine = np.clip(np.sum(normal * halfway, axis=1), 0, 1)
    gloss = (0.42 * shine**60 + 0.085 * shine**9) * lit
    # The edge of a body, seen at a grazing angle, reflects the sky.
    rim = np.clip(1 + np.sum(normal * sight, axis=1), 0, 1) ** 3 * 0.10
    # Surfaces that face up receive more light from the sky.
    ambient = (0.26 + 0.24 * (0.5 + 0.5 * normal[:, 2])) * sky
    # Neighbouring bodies reflect light in their own colour onto each other.
    glow = 0.10 * sky
    base = colour * (0.93 * diffuse + ambient)[:, None] + colour * glow[:, None]
    band.image[hit] = base + (gloss + rim * sky)[:, None]


def _paint_plate(band: Band, camera: Camera, frame: np.ndarray) -> None:
    """Paint the plate, which fades out far from the bodies.

    The numbers of the fading were chosen by eye.

    Parameters
    ----------
    band : Band
        Rows of the picture, whose pixels are written to.
    camera : Camera
        The camera.
    frame : array (M, 3)
        Points in m. The plate is visible around their middle.
    """
    mask = band.view.plate
    if not mask.any():
        return
    low = np.min(frame, axis=0)[:2]
    high = np.max(frame, axis=0)[:2]
    from_middle = band.places(camera, mask)[:, :2] - (low + high) / 2
    distance = np.hypot(from_middle[:, 0], from_middle[:, 1])
    diagonal = np.linalg.norm(high - low)
    # Share of the plate's colour: 1 up to half a diagonal, 0 from 1.3 diagonals on.
    opacity = np.clip((2.6 - 2 * distance / diagonal) / 1.6, 0, 1) ** 1.5
    plate = PLATE_COLOUR * 1.13 * band.tone(mask)[:, None]
    band.image[mask] = BACKGROUND_COLOUR + opacity[:, None] * (
        plate - BACKGROUND_COLOUR
    )


def _paint_backdrop(band: Band, camera: Camera, backdrop: DrumInside | None) -> None:
    """Paint the backdrop, if there is one."""
    mask = band.view.behind
    if backdrop is not None and mask.any():
        band.image[mask] = backdrop.compute_colours(
            band.places(camera, mask),
            band.view.normal[mask],
            band.lit[mask],
            band.sky[mask],
        )


def _paint_panels(band: Band) -> None:
    """Paint flat walls, the steeper ones in a darker tone."""
    mask = band.view.panel
    steepness = 0.80 + 0.20 * np.clip(band.view.normal[mask][:, 2], 0, 1)
    tone = (band.tone(mask) * steepness)[:, None]
    band.image[mask] = PLATE_COLOUR * 1.13 * PANEL_FRACTION * tone


# --- Walls of glass -------------------------------------------------------------------


def _sort_far_to_near(walls: Sequence[Frustum], camera: Camera) -> list[int]:
    """Sort the sides of translucent walls by their distance, the farthest first.

    Each frustum has two sides, which have consecutive numbers. They are sorted by their
    median distance along some thousands of rays.

    Parameters
    ----------
    walls : sequence of Frustum
        The walls.
    camera : Camera
        The camera.

    Returns
    -------
    list of int
        Numbers of the sides.
    """
    step = max(1, camera.height // 100)
    rays = camera.rays(slice(None, None, step))[:, ::step]
    median_distances = [
        np.nanmedian(side.distance)
        for wall in walls
        for side in _find_cone_sides(wall, camera, rays)
    ]
    side_numbers = range(len(median_distances))
    return sorted(side_numbers, key=lambda number: -median_distances[number])


def _find_cone_sides(wall: Frustum, camera: Camera, rays: np.ndarray) -> list[ConeSide]:
    """Find where rays meet the endless cone of a frustum.

    Parameters
    ----------
    wall : Frustum
        The frustum.
    camera : Camera
        The camera, from which the rays come.
    rays : array (H, W, 3)
        Directions of the rays, scaled to unit depth.

    Returns
    -------
    list of ConeSide
        The far and the near side.
    """
    # Transform the rays to the frame of the wall, in which its axis is the z axis.
    rotation = np.reshape(wall.frame[3:], (3, 3)).astype(float)
    eye = (camera.eye_m - wall.frame[:3]) @ rotation
    local_rays = rays @ rotation
    # Compute the radius of the cone at the height of the eye, and its increase along
    # each ray.
    radius = wall.r_low_m + wall.slope * (eye[2] - wall.z_low_m)
    radius_gain = wall.slope * local_rays[..., 2]
    # A point eye + t * ray is on the cone where a t^2 + 2 b t + c = 0.
    x = local_rays[..., 0]
    y = local_rays[..., 1]
    a = x**2 + y**2 - radius_gain**2
    b = x * eye[0] + y * eye[1] - radius_gain * radius
    c = eye[0] ** 2 + eye[1] ** 2 - radius**2
    root = np.sqrt(np.maximum(b * b - a * c, 0))
    with np.errstate(divide="ignore", invalid="ignore"):
        return [
            ConeSide(wall, distance=(-b + sign * root) / a, is_met=root > 0)
            for sign in (1.0, -1.0)
        ]


def _blend_walls(
    band: Band, camera: Camera, walls: Sequence[Frustum], order: Sequence[int]
) -> None:
    """Blend translucent walls into the picture, the farthest sides first.

    Parameters
    ----------
    band : Band
        Rows of the picture, whose pixels are changed.
    camera : Camera
        The camera.
    walls : sequence of Frustum
        The walls.
    order : sequence of int
        Numbers of their sides from far to near, from `_sort_far_to_near`.
    """
    sides = [
        side for wall in walls for side in _find_cone_sides(wall, camera, band.rays)
    ]
    for number in order:
        _blend_side(band, camera, sides[number])


def _compute_cone_normals(points: np.ndarray, slope: float) -> np.ndarray:
    """Compute the unit normals (M, 3) of a cone, which point away from its axis.

    Parameters
    ----------
    points : array (M, 3)
        Points on the cone, whose axis is the z axis.
    slope : float
        Increase of the cone's radius over increase of height. If it is positive, the
        normals point downwards.

    Returns
    -------
    array (M, 3)
        The normals.
    """
    normals = points / np.hypot(points[:, 0], points[:, 1])[:, None]
    normals[:, 2] = -slope
    return normals / math.hypot(1.0, slope)


def _blend_side(band: Band, camera: Camera, side: ConeSide) -> None:
    """Blend one side of a glass wall into the picture, where no body hides it.

    The weights of opacity and shine were chosen by eye.

    Parameters
    ----------
    band : Band
        Rows of the picture, whose pixels are changed.
    camera : Camera
        The camera.
    side : ConeSide
        The side, and where the rays through these pixels meet it.
    """
    wall, distance, is_met = side
    rotation = np.reshape(wall.frame[3:], (3, 3)).astype(float)
    eye = camera.eye_m - wall.frame[:3]

    # The frustum is the part of the endless cone between its two ends.
    height = eye @ rotation[:, 2] + distance * (band.rays @ rotation[:, 2])
    mask = is_met & (distance > 0) & (distance < band.view.depth)
    mask &= (height >= wall.z_low_m) & (height <= wall.z_high_m)
    if not mask.any():
        return

    # Transform points and directions to the frame of the wall.
    rays = band.rays[mask]
    point = (eye + distance[mask][:, None] * rays) @ rotation
    sight = rays @ rotation / np.linalg.norm(rays, axis=1, keepdims=True)
    towards_light = _compute_light_direction(camera) @ rotation
    normal = _compute_cone_normals(point, wall.slope)

    # Glass is least transparent at its ends, and where it is seen at a grazing angle.
    grazing = 1 - np.abs(np.sum(normal * sight, axis=1))
    height_on_side = height[mask]
    to_end = np.minimum(height_on_side - wall.z_low_m, wall.z_high_m - height_on_side)
    is_rim = to_end < RIM_WIDTH_M
    opacity = np.clip(0.07 + 0.45 * grazing**3 + 0.45 * is_rim, 0, 0.75)
    shine = 0.35 * np.clip(np.abs(normal @ towards_light), 0, 1) ** 12
    background = band.image[mask]
    band.image[mask] += opacity[..., None] * (
        FUNNEL_COLOUR + shine[:, None] - background
    )
