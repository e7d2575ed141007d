"""Shaded pictures of grains, drawn in software: no graphics card, no window, the same picture everywhere.

Every shape is tessellated once by its support points x(n), whose normal is n itself, so the shading is as smooth as the
body (`bodies`). Triangles go through a z-buffer (`view`). A second z-buffer seen from the light gives soft shadows, and
the hemisphere above each visible point, sampled in the picture, darkens the gaps of the pile (`shading`).
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from repose.dem import Simulation
from repose.report.renderer import shading
from repose.report.renderer.backdrop import DrumInside
from repose.report.renderer.bodies import Bodies, Drawable, place_bodies
from repose.report.renderer.scenery import (
    Frustum,
    Setting,
    look_at,
    outline,
    setting_of,
)

if TYPE_CHECKING:
    import trimesh


def render_pile(
    centres_m: np.ndarray,
    quaternions: np.ndarray,
    particle: Drawable,
    walls: Sequence[Frustum] = (),
    backdrop: DrumInside | None = None,
    **view: Any,
) -> np.ndarray:
    """Give a shaded picture (height, width, 3), RGB, of grains of one shape; `view` goes to `render_bodies`.

    `walls` are drawn translucent; a `backdrop` replaces the plate at z = 0.
    """
    setting = Setting(None if backdrop else 0.0, frusta=tuple(walls), backdrop=backdrop)
    return render_bodies(centres_m, quaternions, [particle], setting=setting, **view)


def render_bodies(
    centres_m: np.ndarray,
    quaternions: np.ndarray,
    shapes: Sequence[Drawable],
    shape_ids: np.ndarray | None = None,
    scales: np.ndarray | None = None,
    setting: Setting | None = None,
    width: int = 1000,
    height: int | None = None,
    frame_m: np.ndarray | None = None,
    supersample: int = 2,
    colour: str = shading.GRAIN,
    **angles: Any,
) -> np.ndarray:
    """Give a shaded picture (height, width, 3), RGB, of bodies of several shapes and sizes; same input, same picture.

    A body with a NaN is not drawn. `quaternions` are w, x, y, z, body to world; `shape_ids` are places in `shapes`, by
    default the first. The default `setting` is a plate at z = 0. The picture contains the points `frame_m` (M, 3), by
    default all bodies and walls. `height` is 0.6 of the width by default. `supersample` is the number of rays along
    each side of a pixel; `colour` (#rrggbb) is of the first shape. `angles` are the camera's: `elevation_deg`,
    `azimuth_deg` and `field_of_view_deg`, as of `look_at`.
    """
    setting = setting or Setting()
    height = height or round(0.6 * width)
    shown = np.flatnonzero(np.isfinite(centres_m).all(axis=1))
    centres = np.asarray(centres_m, float)[shown]
    kinds = (
        np.zeros(len(shown), int) if shape_ids is None else np.asarray(shape_ids)[shown]
    )
    sizes = np.ones(len(shown)) if scales is None else np.asarray(scales, float)[shown]
    bodies = place_bodies(
        centres, np.asarray(quaternions, float)[shown], shapes, kinds, sizes
    )
    frame = (
        frame_m
        if frame_m is not None
        else outline(centres, bodies.largest_m, setting.frusta, setting.panels)
    )
    rays = (width * supersample, height * supersample)
    camera = look_at(frame, *rays, **angles)
    tints = shading.tints_of(
        shown[bodies.owner], kinds[bodies.owner], len(centres_m), len(shapes), colour
    )
    return shading.paint(camera, bodies, tints, frame, setting, supersample)


def render_mesh(
    mesh: "trimesh.Trimesh",
    frame_m: np.ndarray,
    supersample: int,
    colour: str,
    **view: Any,
) -> np.ndarray:
    """Give a shaded picture (height, width, 3), RGB, of one mesh in m; `view` are its size and the camera's angles."""
    view |= {side: view[side] * supersample for side in ("width", "height")}
    one, vertices = np.zeros(1, int), np.asarray(mesh.vertices)[None]
    normals, faces = np.asarray(mesh.vertex_normals)[None], np.asarray(mesh.faces)
    bodies = Bodies(
        normals,
        faces,
        one,
        np.eye(3)[None],
        vertices,
        one,
        float(np.linalg.norm(mesh.extents)) / 2,
    )
    tints = shading.tints_of(one, one, 1, 1, colour)
    return shading.paint(
        look_at(frame_m, **view), bodies, tints, frame_m, Setting(None), supersample
    )


def render_simulation(simulation: Simulation, **view: Any) -> np.ndarray:
    """Give a shaded picture (height, width, 3), RGB, of a simulation as it is; `view` goes to `render_bodies`."""
    centres = np.where(simulation.present[:, None], simulation.positions, np.nan)
    looks = list(simulation.shapes.values()), simulation.shape_ids, simulation.scales
    return render_bodies(
        centres, simulation.quaternions, *looks, setting_of(simulation), **view
    )
