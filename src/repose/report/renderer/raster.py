"""Picture kernels of `repose.report.renderer.render`: z-buffer, soft shadow, ambient occlusion; pixels and floats only."""

import math

import numpy as np

from repose.dem.kernels.jit import compiled


@compiled
def _rasterise(x, y, near, triangles, nearest, body, weights, corner):
    """z-buffer of all triangles that face the viewer: the largest `near` wins."""
    rows, columns = nearest.shape
    for b in range(x.shape[0]):
        for t in range(triangles.shape[0]):
            i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
            x0, y0, x1, y1, x2, y2 = (
                x[b, i],
                y[b, i],
                x[b, j],
                y[b, j],
                x[b, k],
                y[b, k],
            )
            area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
            if area >= 0.0:
                continue
            share = 1.0 / area
            first_row = max(0, math.ceil(min(y0, y1, y2) - 0.5))
            last_row = min(rows - 1, math.floor(max(y0, y1, y2) - 0.5))
            first_column = max(0, math.ceil(min(x0, x1, x2) - 0.5))
            last_column = min(columns - 1, math.floor(max(x0, x1, x2) - 0.5))
            for row in range(first_row, last_row + 1):
                for column in range(first_column, last_column + 1):
                    px, py = column + 0.5, row + 0.5
                    u = ((px - x0) * (y2 - y0) - (x2 - x0) * (py - y0)) * share
                    v = ((x1 - x0) * (py - y0) - (px - x0) * (y1 - y0)) * share
                    if u < 0.0 or v < 0.0 or u + v > 1.0:
                        continue
                    depth = (
                        near[b, i]
                        + u * (near[b, j] - near[b, i])
                        + v * (near[b, k] - near[b, i])
                    )
                    if depth > nearest[row, column]:
                        nearest[row, column] = depth
                        body[row, column] = b
                        corner[row, column] = t
                        weights[row, column, 0] = u
                        weights[row, column, 1] = v


def draw(
    x: np.ndarray,
    y: np.ndarray,
    near: np.ndarray,
    triangles: np.ndarray,
    shape: tuple[int, int],
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Draw triangles of N bodies with V points each into a z-buffer (H, W); a larger `near` is nearer.

    `x` and `y` (N, V) are in pixels, row 0 on top; `triangles` (T, 3) of closed surfaces are the same for all bodies,
    anticlockwise seen from outside. Returns `near` of the visible point (minus infinity if none), the body's number (-1
    if none), the triangle's number and the shares (H, W, 2) of its second and third point.
    """
    nearest = np.full(shape, -np.inf, np.float32)
    body, corner = np.full(shape, -1, np.int32), np.zeros(shape, np.int32)
    weights = np.zeros((*shape, 2), np.float32)
    if len(x):
        _rasterise(x, y, near, triangles, nearest, body, weights, corner)
    return nearest, body, corner, weights


@compiled
def _noise(row, column):
    """Draw a fixed angle for each pixel, so that few samples give fine grain instead of bands."""
    grain = 0.06711056 * column + 0.00583715 * row
    grain = 52.9829189 * (grain - math.floor(grain))
    return 2 * math.pi * (grain - math.floor(grain))


@compiled
def _spiral(taps):
    """Offsets (taps,), (taps,) that fill the unit disc evenly."""
    across, down = np.empty(taps), np.empty(taps)
    for tap in range(taps):
        radius = math.sqrt((tap + 0.5) / taps)
        across[tap] = radius * math.cos(2.399963 * tap)
        down[tap] = radius * math.sin(2.399963 * tap)
    return across, down


@compiled
def place_of(camera, shape, row, column, depth, place):
    """Write the place (3,) in m at a depth along the ray of a pixel."""
    eye, axes, focal = camera
    right, up = (
        (column + 0.5 - shape[1] / 2) / focal,
        (shape[0] / 2 - row - 0.5) / focal,
    )
    for k in range(3):
        place[k] = eye[k] + depth * (right * axes[0, k] + up * axes[1, k] + axes[2, k])


@compiled
def lit_fraction(
    depth, normals, camera, light_map, axes, origin, pixel_m, softness_m, bias_m, taps
):
    """Share (H, W) of the light that reaches each visible point, from a depth map seen from the light; else 1.

    `light_map` holds the largest height towards the light in m; the rows of `axes` are two axes across the light, then
    towards it; `origin` is in m across the light. `softness_m` is the radius of the `taps` samples, `bias_m` the
    distance at which a surface begins to shade a point. `camera` is as in `place_of`.
    """
    rows, columns = depth.shape
    lit = np.ones((rows, columns), np.float32)
    across, down = _spiral(taps)
    point, place, reach = np.empty(3), np.empty(3), 1.0 + softness_m / pixel_m
    for row in range(rows):
        for column in range(columns):
            if math.isinf(depth[row, column]):
                continue
            place_of(camera, depth.shape, row, column, depth[row, column], point)
            for axis in range(3):
                place[axis] = 0.0
                for k in range(3):
                    place[axis] += (point[k] + normals[row, column, k] * bias_m) * axes[
                        axis, k
                    ]
            u, v = (place[0] - origin[0]) / pixel_m, (place[1] - origin[1]) / pixel_m
            if not (
                -reach < u < light_map.shape[1] + reach
                and -reach < v < light_map.shape[0] + reach
            ):
                continue
            spin = _noise(row, column)
            turn_x, turn_y = softness_m * math.cos(spin), softness_m * math.sin(spin)
            open_taps = 0
            for tap in range(taps):
                u = int(
                    (place[0] + turn_x * across[tap] - turn_y * down[tap] - origin[0])
                    / pixel_m
                )
                v = int(
                    (place[1] + turn_y * across[tap] + turn_x * down[tap] - origin[1])
                    / pixel_m
                )
                inside = 0 <= u < light_map.shape[1] and 0 <= v < light_map.shape[0]
                if not inside or light_map[v, u] <= place[2] + bias_m:
                    open_taps += 1
            lit[row, column] = open_taps / taps
    return lit


@compiled
def openness(depth, normals, camera, mask, radius_m, taps):
    """Share (H, W) of the sky that each visible point sees past its neighbours in the picture; 1 outside `mask`."""
    rows, columns = depth.shape
    open_sky = np.ones((rows, columns), np.float32)
    across, down = _spiral(taps)
    here, there = np.empty(3), np.empty(3)
    for row in range(rows):
        for column in range(columns):
            if not mask[row, column] or math.isinf(depth[row, column]):
                continue
            place_of(camera, depth.shape, row, column, depth[row, column], here)
            spin, reach_px = (
                _noise(row, column),
                radius_m * camera[2] / depth[row, column],
            )
            turn_x, turn_y = reach_px * math.cos(spin), reach_px * math.sin(spin)
            hidden = 0.0
            for tap in range(taps):
                r = int(row + turn_y * across[tap] + turn_x * down[tap])
                c = int(column + turn_x * across[tap] - turn_y * down[tap])
                if not (0 <= r < rows and 0 <= c < columns) or math.isinf(depth[r, c]):
                    continue
                place_of(camera, depth.shape, r, c, depth[r, c], there)
                height, length = 0.0, 1e-18
                for k in range(3):
                    step = there[k] - here[k]
                    height += step * normals[row, column, k]
                    length += step * step
                length = math.sqrt(length)
                hidden += max(0.0, height / length - 0.08) * max(
                    0.0, 1.0 - 0.4 * length / radius_m
                )
            open_sky[row, column] = max(0.0, 1.0 - 1.9 * hidden / taps)
    return open_sky
