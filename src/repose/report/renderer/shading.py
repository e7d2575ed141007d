"""Colour a picture of grains, with light, shadows, open sky, plate and glass walls."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.ndimage import maximum_filter

from repose.report.renderer import raster
from repose.report.renderer.backdrop import DrumInside
from repose.report.renderer.bodies import Bodies
from repose.report.renderer.scenery import Camera, Frustum, Scenery
from repose.report.renderer.view import View, compute_view

BACKGROUND_COLOUR = np.array([0.975, 0.977, 0.980])
PLATE_COLOUR = np.array([0.835, 0.842, 0.850])
GLASS_COLOUR = np.array([0.40, 0.50, 0.58])
GRAIN_COLOUR = "#cca86b"  # default colour of the first shape
# Colours of the second shape and of further ones.
OTHER_SHAPE_COLOURS = np.array(
    [[0.30, 0.42, 0.56], [0.45, 0.52, 0.26], [0.76, 0.125, 0.045]]
)
# Random differences between bodies, at most: of their brightness as a fraction, and of
# red, green and blue for a body that is more or less yellow. Chosen by eye.
BRIGHTNESS_VARIATION = 0.16
YELLOW_VARIATION = np.array([0.045, 0.050, 0.004])
VARIATION_SEED = 2026  # gives a body the same colour in every picture
PLATE_BRIGHTNESS = 1.13  # factor of the plate's colour
PANEL_FRACTION = 0.93  # of the plate's brightness
# The plate is fully visible up to the first of these distances from the middle of the
# picture, and invisible beyond the second. Both are multiples of the diagonal of the
# bodies and walls, as seen from above.
FADE_START = 0.5
FADE_END = 1.3
FADE_EXPONENT = 1.5  # larger than 1: the plate fades faster near the middle
UP = np.array([0.0, 0.0, 1.0])
# Direction towards the light, a unit vector: its components to the right of the camera,
# ahead of it, and up. The light is above and behind the camera.
LIGHT_DIRECTION = np.array([0.42, -0.38, 0.82]) / np.linalg.norm([0.42, -0.38, 0.82])
# If the horizontal component of the viewing direction is smaller than this, the camera
# looks straight up or down, and this component gives no direction.
MIN_HORIZONTAL_LENGTH = 1e-9
LIGHT_PIXELS = 1400  # along the longer side of the depth map seen from the light
# Lengths as multiples of the largest body's radius: radius of the soft edge of a
# shadow, distance at which a surface begins to cast a shadow, and distance within which
# neighbours hide the sky
SOFTNESS_FRACTION = 0.35
BIAS_FRACTION = 0.03
SKY_REACH_FRACTION = 1.3
# Numbers of samples around a visible point: on the depth map of the light, and in the
# picture
LIGHT_SAMPLES = 24
SKY_SAMPLES = 20
# Glass walls. Opacity of a wall seen face on, and what is added to it at a grazing
# angle and at an end of the wall; the sum is limited. All were chosen by eye.
FACE_OPACITY = 0.07
GRAZING_OPACITY = 0.45
RIM_OPACITY = 0.45
MAX_OPACITY = 0.75
RIM_WIDTH_M = 0.0012  # of the ends of a frustum
# Brightness of a highlight, and an exponent: the larger, the smaller the highlight.
GLASS_HIGHLIGHT = 0.35
GLASS_HIGHLIGHT_EXPONENT = 12


class Band(NamedTuple):
    """Some rows of a picture: R rows of W pixels."""

    image: np.ndarray  # (R, W, 3), to be painted
    view: View
    rays: np.ndarray  # (R, W, 3)
    light_fraction: np.ndarray  # (R, W), of the light that reaches each visible point
    sky_fraction: np.ndarray  # (R, W), of the sky that each visible point sees

    def compute_points(self, camera: Camera, mask: np.ndarray) -> np.ndarray:
        """Return the points (M, 3) in m of the world that the pixels of a mask show."""
        return camera.eye_m + self.view.depth[mask][:, None] * self.rays[mask]

    def compute_brightness(self, mask: np.ndarray) -> np.ndarray:
        """Return the brightness (M,) of a dull surface in the pixels of a mask.

        The weights were chosen by eye. A surface in the deepest shadow is not black.
        """
        light = 0.52 + 0.48 * self.light_fraction[mask]
        sky = 0.35 + 0.65 * self.sky_fraction[mask]
        return light * sky


class LightMap(NamedTuple):
    """A depth map seen from the light."""

    heights: np.ndarray  # (rows, columns), largest height towards the light in m
    origin: np.ndarray  # (2,), corner of the map in m across the light
    pixel_m: float  # side of a pixel


class ConeSide(NamedTuple):
    """Where rays meet the far or near side of the infinite cone of a frustum."""

    wall: Frustum
    distance: np.ndarray  # (H, W), along each ray; negative behind the camera
    is_met: np.ndarray  # (H, W), whether the line of the ray meets the cone


def choose_colours(
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
        For each part, the index of its body and the index of its shape.
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
    # a fixed seed. NumPy never changes the numbers of a `RandomState`, so neither do
    # the pictures.
    random = np.random.RandomState(VARIATION_SEED)
    yellowness, lightness = random.uniform(-1, 1, (2, n_bodies))
    brightness = 1 + BRIGHTNESS_VARIATION * lightness[body_of_part, None]
    yellow = YELLOW_VARIATION * yellowness[body_of_part, None]
    return colour_of_shape[shape_of_part] * brightness + yellow


def paint_picture(
    camera: Camera,
    bodies: Bodies,
    colours: np.ndarray,
    focus_points: np.ndarray,
    scenery: Scenery,
    supersample: int,
) -> np.ndarray:
    """Paint the picture that a camera takes of bodies.

    Parameters
    ----------
    camera : Camera
        The camera. Each of its pixels is a ray, and a pixel of the picture averages
        `supersample` rays along each side. Its width and height are multiples of
        `supersample`.
    bodies : Bodies
        The bodies.
    colours : array (N, 3)
        Colours of the parts of the bodies, from `choose_colours`.
    focus_points : array (M, 3)
        Points in m. The plate fades out with the distance from their middle.
    scenery : Scenery
        Walls, plate and backdrop.
    supersample : int
        Number of rays along each side of a pixel.

    Returns
    -------
    array (H / supersample, W / supersample, 3) of uint8
        Red, green and blue.
    """
    view = compute_view(camera, bodies, scenery)
    light_fraction, sky_fraction = _compute_light_and_sky(camera, bodies, view)
    height = camera.height // supersample
    width = camera.width // supersample
    picture = np.empty((height, width, 3), np.uint8)
    # The walls are sorted only once, so that their order is the same in all bands.
    order = _sort_far_to_near(scenery.frusta, camera)
    # Paint the picture in bands of rows, which saves memory. The functions below write
    # into `image`. Paint the opaque surfaces first, in any order, because a pixel shows
    # only one of them. Then blend the glass walls over them.
    for rows in camera.bands(supersample):
        rays = camera.rays(rows)
        image = np.broadcast_to(BACKGROUND_COLOUR, rays.shape).copy()
        band = Band(
            image,
            view.rows(rows),
            rays=rays,
            light_fraction=light_fraction[rows],
            sky_fraction=sky_fraction[rows],
        )
        _paint_plate(band, camera, focus_points)
        _paint_backdrop(band, camera, scenery.backdrop)
        _paint_panels(band)
        _paint_bodies(band, camera, colours)
        _blend_walls(band, camera, walls=scenery.frusta, order=order)
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
    light_fraction, sky_fraction : array (H, W)
        The fractions; both are 1 in a pixel that shows nothing.
    """
    if not len(bodies.vertices):
        # Only bodies cast shadows and hide the sky.
        all_light, whole_sky = np.ones((2, *view.depth.shape), np.float32)
        return all_light, whole_sky
    # The compiled loops take only positional arguments, and the camera as a tuple.
    kernel_camera = (camera.eye_m, camera.axes, float(camera.focal_px))
    light_axes = _compute_light_axes(camera)
    light_map = _draw_light_map(bodies, light_axes)
    light_fraction = raster.compute_lit_fraction(
        view.depth,
        view.normal,
        kernel_camera,
        light_map.heights,
        light_axes,
        light_map.origin,
        light_map.pixel_m,
        SOFTNESS_FRACTION * bodies.largest_m,
        BIAS_FRACTION * bodies.largest_m,
        LIGHT_SAMPLES,
    )
    # Surfaces far from all bodies see the whole sky, so sample only the pixels near a
    # body. Convert the reach to pixels at the nearest body, where it covers the most
    # pixels. If no pixel shows a body, the reach is 0 pixels.
    reach_m = SKY_REACH_FRACTION * bodies.largest_m
    nearest_m = view.depth[view.hit].min(initial=np.inf)
    reach_px = math.ceil(reach_m * camera.focal_px / nearest_m)
    is_near_body = maximum_filter(view.hit, size=2 * reach_px + 1)
    sky_fraction = raster.compute_openness(
        view.depth, view.normal, kernel_camera, is_near_body, reach_m, SKY_SAMPLES
    )
    return light_fraction, sky_fraction


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
    # forward. A camera of `look_at` is never tilted sideways, so its right axis is
    # horizontal.
    right, top_of_picture, forward = camera.axes
    horizontal_forward = forward * (1.0, 1.0, 0.0)
    length = np.linalg.norm(horizontal_forward)
    if length > MIN_HORIZONTAL_LENGTH:
        ahead = horizontal_forward / length
    else:
        # If the camera looks straight down, use the direction of the picture's top.
        ahead = top_of_picture
    # These three axes are perpendicular, so the result has the length 1 of
    # `LIGHT_DIRECTION`.
    to_right, to_ahead, to_up = LIGHT_DIRECTION
    return to_right * right + to_ahead * ahead + to_up * UP


def _compute_light_axes(camera: Camera) -> np.ndarray:
    """Compute the axes of a picture that is seen from the light.

    Parameters
    ----------
    camera : Camera
        The camera, which determines the direction of the light.

    Returns
    -------
    array (3, 3)
        Rows: two unit vectors across the light, of which the first is horizontal, and
        the unit vector towards the light. They are perpendicular to each other.
    """
    towards_light = _compute_light_direction(camera)
    across = np.cross(UP, towards_light)
    across /= np.linalg.norm(across)
    second_across = np.cross(towards_light, across)
    return np.stack([across, second_across, towards_light])


def _draw_light_map(bodies: Bodies, axes: np.ndarray) -> LightMap:
    """Draw the depth map of the bodies as seen from the light.

    The map shows how far each point of a surface reaches towards the light. A visible
    point lies in the shadow if the map is higher there.

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
    pixel_m = float(extent.max() / LIGHT_PIXELS)  # above 0, because bodies have a size
    x = (points[..., 0] - corner[0]) / pixel_m
    y = (points[..., 1] - corner[1]) / pixel_m
    # Add a margin of one pixel beyond the last row and column that contain a point.
    shape = (int(y.max()) + 2, int(x.max()) + 2)
    # The rows of the map are counted upwards, unlike those of a picture, so the map is
    # a mirror image. Reverse the order of the corners of each triangle, so that
    # `draw_triangles` still draws the triangles that face the light.
    reversed_triangles = bodies.triangles[:, ::-1]
    heights, *_ = raster.draw_triangles(
        x, y, nearness=points[..., 2], triangles=reversed_triangles, shape=shape
    )
    return LightMap(heights, corner, pixel_m)


# --- Opaque surfaces ------------------------------------------------------------------


def _paint_bodies(band: Band, camera: Camera, colours: np.ndarray) -> None:
    """Paint the bodies with the light and shadow on them, and with highlights.

    The colour is a sum of several kinds of light. Their weights were chosen by eye.

    Parameters
    ----------
    band : Band
        Rows of the picture. The pixels of `band.image` that show a body are changed.
    camera : Camera
        The camera.
    colours : array (N, 3)
        Colours of the parts of the bodies.
    """
    hit = band.view.hit
    towards_light = _compute_light_direction(camera)
    colour = np.clip(colours[band.view.body[hit]], 0, 1)
    normal = band.view.normal[hit]
    light = band.light_fraction[hit]
    sky = band.sky_fraction[hit]
    rays = band.rays[hit]
    view_direction = rays / np.linalg.norm(rays, axis=1, keepdims=True)

    # Lambert's law: the brightness is proportional to the cosine of the angle to the
    # light.
    diffuse = np.clip(normal @ towards_light, 0, 1) * light
    # Blinn's highlights: a point is bright if its normal is halfway between the
    # directions to the light and to the viewer. A small bright highlight with a faint
    # wide one around it looks like wax.
    halfway = towards_light - view_direction
    halfway /= np.linalg.norm(halfway, axis=1, keepdims=True)
    alignment = np.clip(np.sum(normal * halfway, axis=1), 0, 1)
    highlight = (0.42 * alignment**60 + 0.085 * alignment**9) * light
    # The edge of a body, seen at a grazing angle, reflects the sky.
    grazing = np.clip(1 + np.sum(normal * view_direction, axis=1), 0, 1)
    edge = grazing**3 * 0.10
    # Surfaces that face up receive more light from the sky.
    ambient = (0.26 + 0.24 * (0.5 + 0.5 * normal[:, 2])) * sky
    # Bodies also reflect light onto each other. Neighbours mostly have the same colour,
    # so use the colour of the body itself.
    reflected = 0.10 * sky
    base = colour * (0.93 * diffuse + ambient)[:, None] + colour * reflected[:, None]
    # Highlights and reflections of the sky are white, whatever the colour of the body.
    band.image[hit] = base + (highlight + edge * sky)[:, None]


def _paint_plate(band: Band, camera: Camera, focus_points: np.ndarray) -> None:
    """Paint the plate, which fades into the background far from the bodies.

    Parameters
    ----------
    band : Band
        Rows of the picture. The pixels of `band.image` that show the plate are changed.
    camera : Camera
        The camera.
    focus_points : array (M, 3)
        Points in m. The plate is visible around their middle.
    """
    mask = band.view.plate
    if not mask.any():
        return
    low = np.min(focus_points, axis=0)[:2]
    high = np.max(focus_points, axis=0)[:2]
    offset = band.compute_points(camera, mask)[:, :2] - (low + high) / 2
    distance = np.hypot(offset[:, 0], offset[:, 1])
    diagonal = np.linalg.norm(high - low)
    # The opacity falls from 1 at the start of the fading to 0 at its end.
    remaining = (FADE_END - distance / diagonal) / (FADE_END - FADE_START)
    opacity = np.clip(remaining, 0, 1) ** FADE_EXPONENT
    plate = PLATE_COLOUR * PLATE_BRIGHTNESS * band.compute_brightness(mask)[:, None]
    band.image[mask] = BACKGROUND_COLOUR + opacity[:, None] * (
        plate - BACKGROUND_COLOUR
    )


def _paint_backdrop(band: Band, camera: Camera, backdrop: DrumInside | None) -> None:
    """Paint the backdrop, if there is one."""
    mask = band.view.backdrop
    if backdrop is not None and mask.any():
        band.image[mask] = backdrop.compute_colours(
            band.compute_points(camera, mask),
            band.view.normal[mask],
            light_fraction=band.light_fraction[mask],
            sky_fraction=band.sky_fraction[mask],
        )


def _paint_panels(band: Band) -> None:
    """Paint flat walls. A steeper wall is darker, which tells walls apart."""
    mask = band.view.panel
    level_factor = 0.80 + 0.20 * np.clip(band.view.normal[mask][:, 2], 0, 1)
    brightness = (band.compute_brightness(mask) * level_factor)[:, None]
    band.image[mask] = PLATE_COLOUR * PLATE_BRIGHTNESS * PANEL_FRACTION * brightness


# --- Walls of glass -------------------------------------------------------------------


def _sort_far_to_near(walls: Sequence[Frustum], camera: Camera) -> list[int]:
    """Sort the sides of translucent walls by their distance, the farthest first.

    Each frustum has two sides, from `_find_cone_sides`, with consecutive indices. They
    are sorted by their median distance along some thousands of rays.

    Parameters
    ----------
    walls : sequence of Frustum
        The walls.
    camera : Camera
        The camera.

    Returns
    -------
    list of int
        Indices of the sides.
    """
    # About 100 rays in each direction are enough for a median.
    step = max(1, camera.height // 100)
    rays = camera.rays(slice(None, None, step))[:, ::step]
    median_distances = [
        np.nanmedian(side.distance)
        for wall in walls
        for side in _find_cone_sides(wall, camera, rays)
    ]
    side_indices = range(len(median_distances))
    return sorted(side_indices, key=lambda index: -median_distances[index])


def _find_cone_sides(wall: Frustum, camera: Camera, rays: np.ndarray) -> list[ConeSide]:
    """Find where rays meet the infinite cone of which a frustum is a part.

    A line meets the cone at two distances, or not at all. They include points behind
    the camera, and points on the other side of the cone's tip. `_blend_side` drops
    both.

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
        The far and the near side. For a ray that is steeper than the cone, their order
        is reversed.
    """
    # Transform the rays to the frame of the wall, in which its axis is the z axis.
    eye = (camera.eye_m - wall.origin_m) @ wall.rotation
    local_rays = rays @ wall.rotation
    # Compute the radius of the cone at the height of the eye, and its increase along
    # each ray.
    radius = wall.r_low_m + wall.slope * (eye[2] - wall.z_low_m)
    radius_increase = wall.slope * local_rays[..., 2]
    # A point eye + t * ray is on the cone where a t^2 + 2 b t + c = 0.
    x = local_rays[..., 0]
    y = local_rays[..., 1]
    a = x**2 + y**2 - radius_increase**2
    b = x * eye[0] + y * eye[1] - radius_increase * radius
    c = eye[0] ** 2 + eye[1] ** 2 - radius**2
    root = np.sqrt(np.maximum(b * b - a * c, 0))
    # If a > 0, the sign + gives the larger distance. If a < 0, it gives the smaller
    # one.
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
        Indices of their sides from far to near, from `_sort_far_to_near`.
    """
    sides = [
        side for wall in walls for side in _find_cone_sides(wall, camera, band.rays)
    ]
    for index in order:
        _blend_side(band, camera, sides[index])


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
    """Blend one side of a glass wall into the picture, where nothing opaque hides it.

    Parameters
    ----------
    band : Band
        Rows of the picture. The pixels of `band.image` that show the side are changed.
    camera : Camera
        The camera.
    side : ConeSide
        The side, and where the rays through these pixels meet it.
    """
    wall = side.wall
    distance = side.distance
    eye = camera.eye_m - wall.origin_m

    # The frustum is the part of the infinite cone between its two ends. Find the pixels
    # that show it.
    axis = wall.rotation[:, 2]
    height = eye @ axis + distance * (band.rays @ axis)
    mask = side.is_met & (distance > 0) & (distance < band.view.depth)
    mask &= (height >= wall.z_low_m) & (height <= wall.z_high_m)
    if not mask.any():
        return

    # From here on, each array has a row for each of these pixels. Transform points and
    # directions to the frame of the wall.
    rays = band.rays[mask]
    point = (eye + distance[mask][:, None] * rays) @ wall.rotation
    view_direction = rays @ wall.rotation / np.linalg.norm(rays, axis=1, keepdims=True)
    towards_light = _compute_light_direction(camera) @ wall.rotation
    normal = _compute_cone_normals(point, wall.slope)

    # Glass is least transparent at its ends, and where it is seen at a grazing angle.
    grazing = 1 - np.abs(np.sum(normal * view_direction, axis=1))
    height_on_side = height[mask]
    distance_to_end = np.minimum(
        height_on_side - wall.z_low_m, wall.z_high_m - height_on_side
    )
    is_rim = distance_to_end < RIM_WIDTH_M
    opacity = np.clip(
        FACE_OPACITY + GRAZING_OPACITY * grazing**3 + RIM_OPACITY * is_rim,
        0,
        MAX_OPACITY,
    )
    alignment = np.clip(np.abs(normal @ towards_light), 0, 1)
    highlight = GLASS_HIGHLIGHT * alignment**GLASS_HIGHLIGHT_EXPONENT
    background = band.image[mask]
    band.image[mask] += opacity[..., None] * (
        GLASS_COLOUR + highlight[:, None] - background
    )
