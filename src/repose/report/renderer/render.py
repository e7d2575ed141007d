"""Draw shaded pictures of grains in software.

They need no graphics card and no window, and are the same everywhere. Every shape is
tessellated once by its support points x(n), whose normal is n itself, so the shading is
as smooth as the body (`bodies`). Triangles go through a z-buffer (`view`). A second
z-buffer seen from the light gives soft shadows, and the hemisphere above each visible
point, sampled in the picture, darkens the gaps of the pile (`shading`).
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
    Scenery,
    find_frame_points,
    look_at,
    make_scenery,
)

if TYPE_CHECKING:
    import trimesh

DEFAULT_HEIGHT_FACTOR = 0.6  # height of a picture over its width


def render_pile(
    centres_m: np.ndarray,
    quaternions: np.ndarray,
    particle: Drawable,
    walls: Sequence[Frustum] = (),
    backdrop: DrumInside | None = None,
    **view: Any,
) -> np.ndarray:
    """Draw a shaded picture of grains of one shape.

    Parameters
    ----------
    centres_m, quaternions : array
        As for `render_bodies`.
    particle : Drawable
        The shape of all grains.
    walls : sequence of Frustum
        Walls that are drawn translucent.
    backdrop : DrumInside, optional
        Drawn instead of the plate at z = 0.
    **view
        Further arguments of `render_bodies`.

    Returns
    -------
    array (height, width, 3) of uint8
        Red, green and blue.
    """
    plate_m = None if backdrop else 0.0
    scenery = Scenery(plate_m, frusta=tuple(walls), backdrop=backdrop)
    return render_bodies(centres_m, quaternions, [particle], scenery=scenery, **view)


def render_bodies(  # noqa: PLR0913  (each has a default that a picture may change)
    centres_m: np.ndarray,
    quaternions: np.ndarray,
    shapes: Sequence[Drawable],
    shape_ids: np.ndarray | None = None,
    scales: np.ndarray | None = None,
    scenery: Scenery | None = None,
    width: int = 1000,
    height: int | None = None,
    frame_m: np.ndarray | None = None,
    supersample: int = 2,
    colour: str = shading.GRAIN_COLOUR,
    **angles: Any,
) -> np.ndarray:
    """Draw a shaded picture of bodies of several shapes and sizes.

    The same input gives the same picture.

    Parameters
    ----------
    centres_m : array (N, 3)
        Centres in m. A body whose centre contains NaN is not drawn.
    quaternions : array (N, 4)
        Orientations w, x, y, z, from the body to the world.
    shapes : sequence of Drawable
        The shapes.
    shape_ids : array (N,) of int, optional
        Index of each body's shape in `shapes`. By default, all have the first shape.
    scales : array (N,), optional
        Sizes of the bodies as multiples of their shapes; 1 by default.
    scenery : Scenery, optional
        Walls, plate and backdrop. The default is a plate at z = 0.
    width, height : int
        Size of the picture in pixels. By default, the height is
        `DEFAULT_HEIGHT_FACTOR` times the width.
    frame_m : array (M, 3), optional
        Points that the picture must contain. By default, it contains all bodies and
        walls.
    supersample : int
        Number of rays along each side of a pixel. The colour of a pixel is their mean,
        which makes edges smooth.
    colour : str
        Colour of the first shape as #rrggbb.
    **angles
        Angles of the camera: `elevation_deg`, `azimuth_deg` and `field_of_view_deg`,
        see `look_at`.

    Returns
    -------
    array (height, width, 3) of uint8
        Red, green and blue.
    """
    # Set the defaults of missing arguments, and drop the bodies that are not drawn.
    scenery = scenery or Scenery()
    height = height or round(DEFAULT_HEIGHT_FACTOR * width)
    shown_indices = np.flatnonzero(np.isfinite(centres_m).all(axis=1))
    centres = np.asarray(centres_m, float)[shown_indices]
    if shape_ids is None:
        shown_ids = np.zeros(len(shown_indices), int)
    else:
        shown_ids = np.asarray(shape_ids)[shown_indices]
    if scales is None:
        shown_scales = np.ones(len(shown_indices))
    else:
        shown_scales = np.asarray(scales, float)[shown_indices]

    bodies = place_bodies(
        centres,
        np.asarray(quaternions, float)[shown_indices],
        shapes=shapes,
        shape_ids=shown_ids,
        scales=shown_scales,
    )
    if frame_m is None:
        frame_m = find_frame_points(
            centres, bodies.largest_m, walls=scenery.frusta, panels=scenery.panels
        )
    # The camera has a pixel for each ray, so it has more pixels than the picture.
    camera = look_at(frame_m, width * supersample, height * supersample, **angles)
    # The colour of a body depends on its index among all bodies, so that it does not
    # change when another body appears.
    colours = shading.choose_colours(
        shown_indices[bodies.body_of_part],
        shown_ids[bodies.body_of_part],
        n_bodies=len(centres_m),
        n_shapes=len(shapes),
        colour=colour,
    )
    return shading.paint_picture(
        camera,
        bodies,
        colours=colours,
        focus_points=frame_m,
        scenery=scenery,
        supersample=supersample,
    )


def render_mesh(
    mesh: "trimesh.Trimesh",
    frame_m: np.ndarray,
    supersample: int,
    colour: str,
    width: int,
    height: int,
    **angles: Any,
) -> np.ndarray:
    """Draw a shaded picture of one mesh, alone.

    Parameters
    ----------
    mesh : Trimesh
        The mesh in m.
    frame_m : array (M, 3)
        Points that the picture contains.
    supersample : int
        Number of rays along each side of a pixel.
    colour : str
        Colour of the mesh, as #rrggbb.
    width, height : int
        Size of the picture in pixels.
    **angles
        Angles of the camera, as for `render_bodies`.

    Returns
    -------
    array (height, width, 3) of uint8
        Red, green and blue.
    """
    first = np.zeros(1, int)  # index of the only body, and of its shape
    bodies = Bodies(
        normals=np.asarray(mesh.vertex_normals)[None],
        triangles=np.asarray(mesh.faces),
        shape_ids=first,
        rotations=np.eye(3)[None],
        vertices=np.asarray(mesh.vertices)[None],
        body_of_part=first,
        largest_m=float(np.linalg.norm(mesh.extents)) / 2,
    )
    camera = look_at(frame_m, width * supersample, height * supersample, **angles)
    colours = shading.choose_colours(
        first, first, n_bodies=1, n_shapes=1, colour=colour
    )
    return shading.paint_picture(
        camera,
        bodies,
        colours=colours,
        focus_points=frame_m,
        scenery=Scenery(None),
        supersample=supersample,
    )


def render_simulation(simulation: Simulation, **view: Any) -> np.ndarray:
    """Draw a shaded picture of the present state of a simulation.

    Parameters
    ----------
    simulation : Simulation
        The simulation.
    **view
        Further arguments of `render_bodies`.

    Returns
    -------
    array (height, width, 3) of uint8
        Red, green and blue.
    """
    centres = np.where(simulation.present[:, None], simulation.positions, np.nan)
    return render_bodies(
        centres,
        simulation.quaternions,
        shapes=list(simulation.shapes.values()),
        shape_ids=simulation.shape_ids,
        scales=simulation.scales,
        scenery=make_scenery(simulation),
        **view,
    )
