"""Draw the bed in the rotating drum before and after its first slip."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from repose.bench.drum import NAME as DRUM
from repose.bench.drum import DrumSettings
from repose.common.files import read_npz, read_table
from repose.grain.particle import Particle
from repose.measure import bed
from repose.measure.silhouette import Grains
from repose.stages.drum_tables import choose_median_run

from . import panels, style
from .registry import Inputs, StudyView

if TYPE_CHECKING:
    from repose.report.renderer.backdrop import DrumInside
    from repose.report.renderer.scenery import Camera

PICTURE_PIXELS = 620  # side of a picture at the default resolution
TEXT_HEIGHT = 0.8  # inches, added to the height of the pictures
TEXT_PT = 7.5  # size of the text below the pictures
# Lower end of the y axis in degrees: at least this far below 0, and at least this far
# below the lowest angle. Its upper end is a multiple of the highest angle.
MIN_BELOW_ZERO_DEG = 3.0
ROOM_BELOW_DEG = 2
ROOM_ABOVE_FACTOR = 1.05
SLIP_COLUMNS = ("seed", "before_turned_deg", "before_time_s")
ARTICLE_RUN_S = 10.0  # time of the article's run, from the start of the filling
# States in the file, and how titles describe them.
STATE_TITLES = {
    "start": "before the rotation",
    "report": "at the reported time",
    "before": "before the slip",
    "after": "after the slip",
}


def draw_states(inputs: Inputs, study: StudyView) -> Figure:
    """Draw views along the axis of the drum, before and after the bed first slips.

    A line in each view shows the surface of the bed. If the bed never slips, the views
    show it before the rotation and at the reported time (`report_s` of the section
    `drum`).

    Parameters
    ----------
    inputs : mapping
        Paths by name. `states` contains the arrays position_STATE (N, 3),
        quaternion_STATE (N, 4) and turned_STATE_deg of each state of one run. In a run
        without a slip, there are no states `before` and `after`. `particle` contains
        the shape of the grains. `runs` has a row for each run, and may be missing.
    study : StudyView
        The study.

    Returns
    -------
    Figure
        The figure.
    """
    from repose.report.renderer.film import make_drum_inside  # slow to import

    settings = study.section(DRUM, DrumSettings)
    arrays = read_npz(
        inputs["states"], ("position_start", "quaternion_start"), "the states of a drum"
    )
    particle = Particle.load(inputs["particle"])
    has_slipped = "position_before" in arrays
    shown_states = ("start", "before", "after") if has_slipped else ("start", "report")

    # The pictures are squares side by side.
    picture_side = style.PAGE / len(shown_states)
    figure = style.new_figure(style.PAGE, picture_side + TEXT_HEIGHT)
    figure.get_layout_engine().set(w_pad=0.02, h_pad=0.02)  # inches
    axes = figure.subplots(1, len(shown_states))
    for k, (panel, state) in enumerate(zip(axes, shown_states, strict=True)):
        grains = _select_grains(arrays, state, particle)
        turned_deg = float(arrays[f"turned_{state}_deg"])
        inside = make_drum_inside(settings, np.radians(turned_deg))
        camera = _draw_state(panel, grains, particle, inside=inside, study=study)
        surface = _measure_surface(grains, inside.radius_m, study)
        _draw_surface(panel, surface.line_m, camera)
        letter = style.panel_letter(k)
        panel.set_title(
            f"{letter}  {STATE_TITLES[state]}: surface {surface.angle_deg:.1f}°"
        )
        panel.set_xlabel(f"drum turned by {turned_deg:.1f}°")
    if has_slipped:
        runs = pd.DataFrame()  # empty if the table is missing
        if "runs" in inputs:
            runs = read_table(inputs["runs"], ("status", *SLIP_COLUMNS))
        text = _describe_slip(float(arrays["turned_before_deg"]), runs, settings)
        text += _describe_end_of_article_run(arrays, settings)
        figure.supxlabel(text, fontsize=TEXT_PT)
    else:
        figure.supxlabel("NO SLIP in this run", fontsize=TEXT_PT, color=style.RED)
    return figure


def _describe_end_of_article_run(
    arrays: Mapping[str, np.ndarray], settings: DrumSettings
) -> str:
    """Describe how far the drum has turned when the article's run ends, in a new line.

    The angle is known only if the reported time is the end of this run. Otherwise the
    text is empty.
    """
    if settings.report_s != ARTICLE_RUN_S or "turned_report_deg" not in arrays:
        return ""
    end_deg = float(arrays["turned_report_deg"])
    return f"\nThe article's run ends at {end_deg:.0f}° and shows the bed after a slip."


def _describe_slip(
    turned_deg: float, runs: pd.DataFrame, settings: DrumSettings
) -> str:
    """Describe by what angle and for how long the drum turned before the first slip.

    Parameters
    ----------
    turned_deg : float
        Angle by which the drum had turned before the slip in the run that is shown.
    runs : DataFrame
        A row for each run, or an empty table. If the beds of at least two runs slipped,
        the means of these runs are added.
    settings : DrumSettings
        The section `drum`.

    Returns
    -------
    str
        One or more sentences.
    """
    seconds = turned_deg / np.degrees(settings.angular_velocity_rad_s)
    slip = (
        f"The bed slipped first when the drum had turned by {turned_deg:.1f}°, after "
        f"{seconds:.1f} s of rotation."
    )
    if runs.empty:
        return slip
    # A run is ok if its bed slipped.
    slipped = runs[runs["status"] == "ok"]
    if len(slipped) < 2:
        return slip
    # The run that is shown is that with the median angle, as `choose_median_run` finds
    # it by its seed. Runs are numbered by their rows, from 1.
    shown_seed = choose_median_run(runs)
    number = runs["seed"].tolist().index(shown_seed) + 1
    angle = _format_mean_and_error(slipped["before_turned_deg"])
    time = _format_mean_and_error(slipped["before_time_s"])
    return (
        f"Run {number} of {len(runs)}, whose slip angle is the median. {slip}\n"
        f"In {len(slipped)} runs, mean ± standard error: {angle}°, {time} s."
    )


def _format_mean_and_error(values: pd.Series) -> str:
    """Write the mean of values with its standard error."""
    return f"{values.mean():.1f} ± {values.sem():.1f}"


def _select_grains(
    arrays: Mapping[str, np.ndarray], state: str, particle: Particle
) -> Grains:
    """Select the positions and orientations of the grains in one state of the drum.

    Parameters
    ----------
    arrays : mapping
        Arrays of the states by name, as for `draw_states`. If there is no array
        `scale`, all grains have the size of `particle`.
    state : str
        The state, one of `STATE_TITLES`.
    particle : Particle
        The shape of the grains.

    Returns
    -------
    Grains
        The grains.
    """
    centres = arrays[f"position_{state}"].astype(float)
    quaternions = arrays[f"quaternion_{state}"].astype(float)
    scales = arrays.get("scale", np.ones(len(centres)))
    return Grains(centres, quaternions, particle=particle, scales=scales)


def _draw_state(
    panel: Axes,
    grains: Grains,
    particle: Particle,
    inside: "DrumInside",
    study: StudyView,
) -> "Camera":
    """Draw a shaded picture of the drum along its axis, with a scale bar.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    grains : Grains
        The grains in the drum.
    particle : Particle
        The shape of the grains.
    inside : DrumInside
        The drum. Marks on its rim show by which angle it has turned.
    study : StudyView
        The study.

    Returns
    -------
    Camera
        The camera of the picture, with which more can be drawn into it.
    """
    # These imports are slow, and the other figure does not need them.
    from repose.report.renderer.render import render_pile
    from repose.report.renderer.scenery import look_at

    # The camera looks along the axis of the drum. Picture and camera must have the same
    # view, so that lines drawn with the camera fit the picture.
    pixels = style.scale_picture_pixels(study, PICTURE_PIXELS)
    view: dict[str, Any] = {
        "elevation_deg": 0.0,
        "azimuth_deg": -90.0,
        "width": pixels,
        "height": pixels,
        "field_of_view_deg": style.TELEPHOTO_DEG,
    }
    frame_m = inside.compute_outline_points()
    picture = render_pile(
        grains.centres_m,
        grains.quaternions,
        particle,
        scales=grains.scales,
        colour=study.settings.colour,
        frame_m=frame_m,
        backdrop=inside,
        **view,
    )
    panel.imshow(picture)
    panel.set(xticks=[], yticks=[])
    panel.spines[:].set_visible(False)
    camera = look_at(frame_m, **view)
    style.draw_scale_bar(
        panel, camera, point_m=np.zeros(3), extent_m=2 * inside.radius_m
    )
    return camera


def _measure_surface(grains: Grains, radius_m: float, study: StudyView) -> bed.Surface:
    """Measure the line of the bed's surface in the silhouette of the grains.

    `radius_m` is the inner radius of the drum.
    """
    settings = study.section(DRUM, DrumSettings)
    mm_per_pixel = study.settings.measure.mm_per_pixel
    silhouette = bed.side_view(grains, radius_m, mm_per_pixel)
    return bed.surface_of(
        silhouette,
        radius_m,
        mm_per_pixel=mm_per_pixel,
        fit_fraction=settings.fit_share,
    )


def _draw_surface(panel: Axes, line_m: np.ndarray, camera: "Camera") -> None:
    """Draw the line of the bed's surface into a picture of the drum.

    Parameters
    ----------
    panel : Axes
        The panel of the picture.
    line_m : ndarray
        Ends (2, 2) of the line, as x and z in m.
    camera : Camera
        The camera of the picture.
    """
    # The line lies in the plane y = 0, across the middle of the drum.
    ends_m = np.insert(line_m, 1, 0.0, axis=1)
    x, y, _ = camera.project(ends_m)
    # Add a white margin, because the line lies over grains.
    panel.plot(x, y, color="white", lw=2.6, solid_capstyle="butt")
    panel.plot(x, y, color=style.GREEN, lw=1.6, solid_capstyle="butt")


def draw_course(inputs: Inputs, study: StudyView) -> Figure:
    """Draw how the bed turns and slips in every run: its angles, and its layers.

    One panel shows the angles of the bed over time. The other one shows how far the
    layers of grains move during the slip, by their depth.

    Parameters
    ----------
    inputs : mapping
        Paths by name. `record` contains two angles at each time of each run: that of
        the surface as `surface_deg`, and that of the bed's centre of mass as `bed_deg`.
        `profile` contains the displacement at each depth as `moved_mm`. `runs` has a
        row for each run.
    study : StudyView
        The study.

    Returns
    -------
    Figure
        The figure.
    """
    record = read_table(inputs["record"], ("seed", "time_s", "surface_deg", "bed_deg"))
    profile = read_table(inputs["profile"], ("seed", "depth_mm", "moved_mm"))
    runs = read_table(inputs["runs"], ("seed", "status"))
    figure, (left, right) = panels.grid(2, 2.9, width_ratios=(1.5, 1))
    _draw_angles(left, record, runs=runs, settings=study.section(DRUM, DrumSettings))
    _draw_layers(right, profile)
    style.label_panels((left, right))
    return figure


def _draw_angles(
    panel: Axes, record: pd.DataFrame, runs: pd.DataFrame, settings: DrumSettings
) -> None:
    """Draw the angles of surface and bed over time, and the start of the first slip.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    record : DataFrame
        A row for each time of each run.
    runs : DataFrame
        A row for each run.
    settings : DrumSettings
        The section `drum`.
    """
    _draw_angles_of_runs(panel, record, runs)
    # A run is ok if its bed slipped.
    slipped = runs[runs["status"] == "ok"]
    if len(slipped):
        _mark_first_slips(panel, slipped, settings)
    # Draw the angle of a bed that turns with the drum like a rigid body.
    last_s = record["time_s"].max()
    turned_deg = np.degrees(settings.angular_velocity_rad_s) * last_s
    panel.plot(
        [0, last_s],
        [0, turned_deg],
        color=style.GREY,
        lw=0.7,
        ls="--",
        label="if the bed turned with the drum",
    )
    if "report_time_s" in runs:
        _mark_reported_time(panel, runs["report_time_s"].median(), settings)
    # Leave room below the lowest angle and above the highest one.
    lowest = min(-MIN_BELOW_ZERO_DEG, record["bed_deg"].min() - ROOM_BELOW_DEG)
    highest_angle = max(record["surface_deg"].max(), record["bed_deg"].max())
    highest = ROOM_ABOVE_FACTOR * highest_angle
    panel.set(
        xlim=(0, last_s),
        ylim=(lowest, highest),
        xlabel="time since the rotation began (s)",
        ylabel="angle (deg)",
    )
    panel.figure.legend(
        *panel.get_legend_handles_labels(), loc="outside upper left", ncols=3
    )
    # Convert rad/s to turns per minute: 60 s over 2 pi.
    turns_per_minute = 30 / np.pi * settings.angular_velocity_rad_s
    style.write_note(
        panel,
        f"drum: diameter {settings.outer_diameter_mm:g} mm,\n"
        f"{turns_per_minute:.2f} turns per minute",
    )


def _mark_reported_time(panel: Axes, time_s: float, settings: DrumSettings) -> None:
    """Mark the time since the rotation began at which the state is reported."""
    name = "the time reported"
    if settings.report_s == ARTICLE_RUN_S:
        name = "end of the article's run"
    panel.axvline(
        time_s,
        color=style.ORANGE,
        lw=1.4,
        label=f"{name}, after {time_s:.1f} s of rotation",
    )


def _mark_first_slips(
    panel: Axes, slipped: pd.DataFrame, settings: DrumSettings
) -> None:
    """Mark when, and at which angle of the centre of mass, each bed slipped first."""
    drop_deg = settings.slip_drop_deg
    panel.plot(
        slipped["before_time_s"],
        slipped["before_bed_deg"],
        "v",
        ms=4,
        color=style.RED,
        zorder=4,
        label=f"first slip begins: highest before a fall by {drop_deg:g}°",
    )


def _draw_angles_of_runs(panel: Axes, record: pd.DataFrame, runs: pd.DataFrame) -> None:
    """Draw the angles of surface and centre of mass of each run, up to its slip.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    record : DataFrame
        A row for each time of each run, with both angles.
    runs : DataFrame
        A row for each run. If its bed slipped, the status is ok, and `after_time_s` is
        the time of the end of the slip.
    """
    for k, (seed, rows) in enumerate(record.groupby("seed")):
        run = runs[runs["seed"] == seed].iloc[0]
        # A run without a slip is drawn to its end.
        if run["status"] == "ok":
            rows = rows[rows["time_s"] <= run["after_time_s"]]
        # Matplotlib leaves labels with an underscore out of the legend, so only the
        # first run adds its labels.
        label_prefix = "" if k == 0 else "_"
        panel.plot(
            rows["time_s"],
            rows["surface_deg"],
            color=style.SKY,
            lw=0.6,
            alpha=0.8,
            label=f"{label_prefix}surface",
        )
        panel.plot(
            rows["time_s"],
            rows["bed_deg"],
            color=style.BLUE,
            lw=0.9,
            label=f"{label_prefix}centre of mass",
        )


def _draw_layers(panel: Axes, profile: pd.DataFrame) -> None:
    """Draw how far the layers of grains moved during the slip, by their depth.

    Parameters
    ----------
    panel : Axes
        The panel to draw in.
    profile : DataFrame
        A row for each layer of each run, with its depth and the distance that it moved
        relative to the drum; empty if no run slipped.
    """
    panel.set(
        xlabel="displacement relative to the drum (mm)",
        ylabel="depth below the surface (mm)",
    )
    panel.invert_yaxis()
    if not len(profile):
        style.write_note(panel, "no slip in any run")
        return
    for k, (_, rows) in enumerate(profile.groupby("seed")):
        panel.plot(
            rows["moved_mm"],
            rows["depth_mm"],
            color=style.SKY,
            lw=0.7,
            # Labels with an underscore do not appear in the legend.
            label="single run" if k == 0 else "_single run",
        )
    # Draw the mean over the runs at each depth.
    layers = profile.groupby("depth_mm")["moved_mm"].agg(["mean", "sem"])
    panel.errorbar(
        layers["mean"],
        layers.index,
        xerr=layers["sem"].fillna(0.0),
        fmt="o-",
        ms=3,
        color=style.BLUE,
        elinewidth=0.9,
        capsize=1.5,
        label="mean ± standard error",
    )
    panel.axvline(0.0, color=style.GREY, lw=0.6)
    panel.legend(loc="lower right")
