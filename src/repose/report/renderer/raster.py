"""Loop over the pixels of a picture in compiled code: z-buffer, soft shadow, open sky.

A `camera` is here a tuple of three items: its position (3,) in m, its axes (3, 3) with
the rows right, up and forward, and its focal length in pixels.
"""

import math

import numpy as np

from repose.dem.kernels.jit import compiled

GOLDEN_ANGLE = 2.399963  # in radians


@compiled
def _rasterise(x, y, nearness, triangles, nearest, body, triangle, weights):
    """Draw all triangles that face the viewer into a z-buffer.

    A pixel keeps the triangle with the largest nearness. The first four parameters are
    those of `draw_triangles`. The others are the arrays that `draw_triangles` returns,
    and are written to.
    """
    rows, columns = nearest.shape
    for b in range(x.shape[0]):
        for t in range(triangles.shape[0]):
            i = triangles[t, 0]
            j = triangles[t, 1]
            k = triangles[t, 2]
            x0 = x[b, i]
            y0 = y[b, i]
            x1 = x[b, j]
            y1 = y[b, j]
            x2 = x[b, k]
            y2 = y[b, k]
            # Twice the area, which is positive if the triangle is seen from behind
            area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
            if area >= 0.0:
                continue
            inverse_area = 1.0 / area
            first_row = max(0, math.ceil(min(y0, y1, y2) - 0.5))
            last_row = min(rows - 1, math.floor(max(y0, y1, y2) - 0.5))
            first_column = max(0, math.ceil(min(x0, x1, x2) - 0.5))
            last_column = min(columns - 1, math.floor(max(x0, x1, x2) - 0.5))
            for row in range(first_row, last_row + 1):
                for column in range(first_column, last_column + 1):
                    # Compute the weights u and v of the second and third corner.
                    px = column + 0.5
                    py = row + 0.5
                    u = ((px - x0) * (y2 - y0) - (x2 - x0) * (py - y0)) * inverse_area
                    v = ((x1 - x0) * (py - y0) - (px - x0) * (y1 - y0)) * inverse_area
                    if u < 0.0 or v < 0.0 or u + v > 1.0:
                        continue
                    pixel_nearness = (
                        nearness[b, i]
                        + u * (nearness[b, j] - nearness[b, i])
                        + v * (nearness[b, k] - nearness[b, i])
                    )
                    if pixel_nearness > nearest[row, column]:
                        nearest[row, column] = pixel_nearness
                        body[row, column] = b
                        triangle[row, column] = t
                        weights[row, column, 0] = u
                        weights[row, column, 1] = v


def draw_triangles(
    x: np.ndarray,
    y: np.ndarray,
    nearness: np.ndarray,
    triangles: np.ndarray,
    shape: tuple[int, int],
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Draw the triangles of N bodies with V points each into a z-buffer.

    Parameters
    ----------
    x, y : array (N, V)
        Positions of the points in pixels, with row 0 at the top.
    nearness : array (N, V)
        Nearness of the points: any number that is larger for a nearer point, and that
        may be interpolated linearly in the picture, such as the inverse depth.
    triangles : array (T, 3) of int
        Indices of the corners of triangles that form a closed surface, in anticlockwise
        order as seen from outside. They are the same for all bodies.
    shape : tuple
        Number of rows H and columns W of the picture.

    Returns
    -------
    nearest : array (H, W)
        Nearness of the visible point; minus infinity if there is none.
    body : array (H, W) of int
        Index of the body of this point; -1 if there is none.
    triangle : array (H, W) of int
        Index of the triangle of this point; 0 if there is none.
    weights : array (H, W, 2)
        Weights of the second and third corner of the triangle at this point.
    """
    nearest = np.full(shape, -np.inf, np.float32)
    body = np.full(shape, -1, np.int32)
    triangle = np.zeros(shape, np.int32)
    weights = np.zeros((*shape, 2), np.float32)
    if len(x):
        _rasterise(x, y, nearness, triangles, nearest, body, triangle, weights)
    return nearest, body, triangle, weights


@compiled
def _compute_pixel_angle(row, column):
    """Compute a fixed angle for a pixel, which differs between neighbours.

    If the samples of each pixel are turned by this angle, few samples cause fine noise
    instead of bands. The numbers are those of interleaved gradient noise (Jimenez 2014,
    Next Generation Post Processing in Call of Duty).
    """
    noise = 0.06711056 * column + 0.00583715 * row
    noise = 52.9829189 * (noise - math.floor(noise))
    return 2 * math.pi * (noise - math.floor(noise))


@compiled
def _make_spiral(n_points):
    """Make points of a spiral that fill the unit disc evenly.

    This is Vogel's spiral, as in the head of a sunflower. Each point is turned by the
    golden angle from the point before it, so the points never line up. The radius grows
    with the square root of the number, so each point has the same area.

    Parameters
    ----------
    n_points : int
        Number of points.

    Returns
    -------
    across, down : array (n_points,)
        Coordinates of the points along the columns and along the rows of a picture.
    """
    across = np.empty(n_points)
    down = np.empty(n_points)
    for k in range(n_points):
        # Adding 0.5 places each point in the middle of its ring.
        radius = math.sqrt((k + 0.5) / n_points)
        across[k] = radius * math.cos(GOLDEN_ANGLE * k)
        down[k] = radius * math.sin(GOLDEN_ANGLE * k)
    return across, down


@compiled
def write_point(camera, shape, row, column, depth, point):
    """Write the point (3,) in m at a depth along the ray of a pixel into `point`."""
    eye, axes, focal = camera
    right = (column + 0.5 - shape[1] / 2) / focal
    up = (shape[0] / 2 - row - 0.5) / focal
    for k in range(3):
        point[k] = eye[k] + depth * (right * axes[0, k] + up * axes[1, k] + axes[2, k])


@compiled
def compute_lit_fraction(
    depth,
    normals,
    camera,
    light_map,
    axes,
    origin,
    pixel_m,
    softness_m,
    bias_m,
    n_samples,
):
    """Compute the fraction of the light that reaches each visible point.

    Parameters
    ----------
    depth : array (H, W)
        Depth of the visible point in m; infinite if there is none.
    normals : array (H, W, 3)
        Unit normals at these points.
    camera : tuple
        The camera, as described in the docstring of the module.
    light_map : array
        Depth map seen from the light: the largest height towards the light in m.
    axes : array (3, 3)
        Rows: two axes across the light, and the axis towards the light.
    origin : array (2,)
        Corner of the map in m across the light.
    pixel_m : float
        Size of a pixel of the map.
    softness_m : float
        Radius of the disc of samples on the map. It makes the edges of shadows soft.
    bias_m : float
        Distance at which a surface begins to cast a shadow on a point.
    n_samples : int
        Number of samples.

    Returns
    -------
    array (H, W)
        The fraction, from 0 to 1.
    """
    rows, columns = depth.shape
    map_rows, map_columns = light_map.shape
    lit = np.ones((rows, columns), np.float32)
    across, down = _make_spiral(n_samples)
    point = np.empty(3)
    light_point = np.empty(3)  # the point in the axes of the light
    reach = 1.0 + softness_m / pixel_m  # of the disc of samples, in pixels of the map
    for row in range(rows):
        for column in range(columns):
            if math.isinf(depth[row, column]):
                continue
            write_point(camera, depth.shape, row, column, depth[row, column], point)
            for axis in range(3):
                light_point[axis] = 0.0
                for k in range(3):
                    light_point[axis] += (
                        point[k] + normals[row, column, k] * bias_m
                    ) * axes[axis, k]
            # If the disc of samples lies outside the map, nothing shades the point.
            u = (light_point[0] - origin[0]) / pixel_m
            v = (light_point[1] - origin[1]) / pixel_m
            if not (-reach < u < map_columns + reach and -reach < v < map_rows + reach):
                continue
            # Turn the disc by a different angle in each pixel.
            angle = _compute_pixel_angle(row, column)
            turn_x = softness_m * math.cos(angle)
            turn_y = softness_m * math.sin(angle)
            n_open = 0
            for sample in range(n_samples):
                map_column = int(
                    (
                        light_point[0]
                        + turn_x * across[sample]
                        - turn_y * down[sample]
                        - origin[0]
                    )
                    / pixel_m
                )
                map_row = int(
                    (
                        light_point[1]
                        + turn_y * across[sample]
                        + turn_x * down[sample]
                        - origin[1]
                    )
                    / pixel_m
                )
                is_inside = 0 <= map_column < map_columns and 0 <= map_row < map_rows
                if (
                    not is_inside
                    or light_map[map_row, map_column] <= light_point[2] + bias_m
                ):
                    n_open += 1
            lit[row, column] = n_open / n_samples
    return lit


@compiled
def compute_openness(depth, normals, camera, mask, radius_m, n_samples):
    """Compute the fraction of the sky that each visible point sees past its neighbours.

    Parameters
    ----------
    depth : array (H, W)
        Depth of the visible point in m; infinite if there is none.
    normals : array (H, W, 3)
        Unit normals at these points.
    camera : tuple
        The camera, as described in the docstring of the module.
    mask : array (H, W) of bool
        Pixels that are near a body. The others see the whole sky.
    radius_m : float
        Radius of the disc of neighbours.
    n_samples : int
        Number of neighbours.

    Returns
    -------
    array (H, W)
        The fraction, from 0 to 1.
    """
    rows, columns = depth.shape
    open_sky = np.ones((rows, columns), np.float32)
    across, down = _make_spiral(n_samples)
    point = np.empty(3)
    neighbour = np.empty(3)
    for row in range(rows):
        for column in range(columns):
            if not mask[row, column] or math.isinf(depth[row, column]):
                continue
            write_point(camera, depth.shape, row, column, depth[row, column], point)
            angle = _compute_pixel_angle(row, column)
            # Convert the disc of neighbours to pixels, and turn it by a different angle
            # in each pixel.
            reach_px = radius_m * camera[2] / depth[row, column]
            turn_x = reach_px * math.cos(angle)
            turn_y = reach_px * math.sin(angle)
            hidden = 0.0
            for sample in range(n_samples):
                r = int(row + turn_y * across[sample] + turn_x * down[sample])
                c = int(column + turn_x * across[sample] - turn_y * down[sample])
                if not (0 <= r < rows and 0 <= c < columns) or math.isinf(depth[r, c]):
                    continue
                write_point(camera, depth.shape, r, c, depth[r, c], neighbour)
                height = 0.0  # of the neighbour above the surface
                squared_distance = 1e-18  # not 0, because the distance is a divisor
                for k in range(3):
                    step = neighbour[k] - point[k]
                    height += step * normals[row, column, k]
                    squared_distance += step * step
                # The higher and the nearer a neighbour is, the more of the sky it
                # hides. Neighbours near the plane of the surface hide nothing, because
                # they may belong to the same surface. Neither do those far away. The
                # numbers were chosen by eye.
                distance = math.sqrt(squared_distance)
                hidden += max(0.0, height / distance - 0.08) * max(
                    0.0, 1.0 - 0.4 * distance / radius_m
                )
            open_sky[row, column] = max(0.0, 1.0 - 1.9 * hidden / n_samples)
    return open_sky
