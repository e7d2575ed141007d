"""The funnel: berries are poured onto a plate and come to rest as a pile (paper, section 3.1).

A pour that gives no pile to measure is a result, too: it has a status and a reason instead of a number.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Field

from repose.apparatus import funnel_advice, funnel_geometry
from repose.apparatus.bench_test import BenchTest, Run, register
from repose.apparatus.funnel_pour import NAME, build, pour, status_of
from repose.apparatus.settings import SimulationSettings
from repose.core.responses import Response
from repose.core.runs import Recorded
from repose.core.section import AUTO, Auto, Berries, Section, Seeds
from repose.measure.angles import MEAN_KEYS, VIEW_KEYS

if TYPE_CHECKING:
    from repose.particle.particle import Particle

STATUSES = ("ok", "jammed", "not_at_rest", "no_flank", "left_plate", "unstable")

# --- what it gives --------------------------------------------------------------------------------

# The keys of `measure` that define what is seen of a pile, and the line along its flank.
SEEN = ("measure.views", "measure.mm_per_pixel", "measure.largest_pile_only")
BERRY = "measure.berry_height_mm"
LINE = ("measure.flank", "measure.fit_from", "measure.fit_to", BERRY)
PLATE = ("funnel.plate_diameter_mm",)


def _angle(definition: str, label: str, keys: tuple[str, ...]) -> Response:
    """The angle by one definition, whichever of them is the angle of repose."""
    return Response(f"aor_{definition}_deg", "deg", label, definition, NAME, 0.0, 89.0, (*SEEN, *keys))


RESPONSES = (
    Response("aor_deg", "deg", "angle of repose", "AoR", NAME, 1.0, 89.0, (*SEEN, *LINE, "measure.response")),
    Response("height_mm", "mm", "Height", "Height", NAME, 1.0, 2000.0, SEEN),
    _angle("flank", "angle, flank", LINE),
    _angle("secant", "angle, secant", (BERRY,)),
    _angle("steepest", "angle, steepest", LINE),
    _angle("whole", "angle, whole side", ("measure.flank",)),
    Response("base_radius_mm", "mm", "base radius", "base radius", NAME, 0.0, 1e4, (*SEEN, BERRY)),
    Response("lower_deg", "deg", "lower flank", "lower flank", NAME, 0.0, 89.0, (*SEEN, BERRY)),
    Response("upper_deg", "deg", "upper flank", "upper flank", NAME, 0.0, 89.0, (*SEEN, BERRY)),
    Response("packing_percent", "%", "packing", "packing", NAME, 0.0, 100.0, (*SEEN, BERRY)),
    Response("radius_90_mm", "mm", "radius of 90 % of the berries", "radius of 90 %", NAME, 0.0, 1e4, PLATE),
    Response("loose_percent", "%", "loose berries", "loose", NAME, 0.0, 100.0, PLATE),
    Response("discharge_s", "s", "discharge time", "discharge", NAME, 0.0, 1e4),
)
# Measured on every pile beside the angle of repose and the Height; the other responses where they are targets.
BESIDE = ("height_view_mm", *MEAN_KEYS.values(), *VIEW_KEYS.values())
ALWAYS = ("aor_deg", "height_mm", *BESIDE)
COUNTED = ("berries_on_plate", "berries_in_pile", "kinetic_energy_J")
RECORDED = Recorded(
    means=("aor_deg", "height_mm", "discharge_s", *BESIDE),
    without_error=("discharge_s",),
    single=("aor_deg", "height_mm", "discharge_s", *COUNTED, *BESIDE),
)

# --- what its configuration asks ------------------------------------------------------------------


class Settings(Section):
    """The section `funnel` of the configuration; config/README.md explains its keys."""

    berries: Berries
    rate_per_s: float = Field(ge=0.1, le=10000)
    duration_s: Annotated[float, Field(ge=0.1, le=600)] | Auto = AUTO
    seeds: Seeds
    inlet_diameter_mm: float = Field(ge=1, le=5000)
    outlet_diameter_mm: float = Field(ge=1, le=5000)
    cone_angle_deg: float = Field(ge=5, le=89)
    tube_length_mm: float = Field(ge=0, le=1000)
    rim_radius_mm: float = Field(ge=0.05, le=20)
    outlet_height_mm: float = Field(ge=1, le=2000)
    plate_diameter_mm: float = Field(ge=10, le=20000)
    factory_height_mm: Annotated[float, Field(ge=0, le=1000)] | Auto = AUTO
    factory_diameter_mm: Annotated[float, Field(ge=1, le=5000)] | Auto = AUTO
    orientation: Literal["random", "lying", "upright"]
    rest_motion_mm: float = Field(gt=0, le=100)
    rest_window_s: float = Field(ge=0.001, le=100)


def contradictions(config: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Keys of a funnel that cannot be built, or of a pour that cannot end.

    Parameters
    ----------
    config : mapping
        The whole configuration.

    Yields
    ------
    key, allowed : str
        Dotted key, and what it may be.
    """
    funnel = config[NAME]
    inlet, outlet = funnel["inlet_diameter_mm"], funnel["outlet_diameter_mm"]
    duration, window = funnel["duration_s"], funnel["rest_window_s"]
    if SimulationSettings.of(config).time_step_s > window / 2:
        yield "simulation.time_step_s", f"at most half of funnel.rest_window_s, {window:g}"
    yield from funnel_geometry.contradictions(config, NAME)
    if funnel["factory_diameter_mm"] > inlet:
        yield "funnel.factory_diameter_mm", f"at most funnel.inlet_diameter_mm, {inlet:g}"
    if funnel["plate_diameter_mm"] < outlet:
        yield "funnel.plate_diameter_mm", f"at least funnel.outlet_diameter_mm, {outlet:g}"
    if window >= duration:
        yield "funnel.rest_window_s", f"below funnel.duration_s, {duration:g}"
    last = (funnel["berries"] - 1) / funnel["rate_per_s"]
    if last >= duration - window:
        yield "funnel.duration_s", f"above {last + window:g}: the last berry appears at {last:g} s"


def misfits(config: Mapping[str, Any], axes_mm: Sequence[float]) -> Iterator[tuple[str, str]]:
    """Keys of openings that are too narrow for the mean berry.

    Parameters
    ----------
    config : mapping
        The whole configuration.
    axes_mm : sequence of float, (3,)
        Mean axes of the berry, the longest first.

    Yields
    ------
    key, allowed : str
        Dotted key, and what it may be.
    """
    for key, smallest in (("outlet_diameter_mm", axes_mm[2]), ("factory_diameter_mm", axes_mm[0])):
        if config[NAME][key] <= smallest:
            yield f"funnel.{key}", f"above {smallest:.4g}, the size of a mean berry"


# --- run ------------------------------------------------------------------------------------------


def run(
    config: Mapping[str, Any],
    parameters: Mapping[str, float],
    seed: int,
    particle: "Particle",
    berry: Mapping[str, Any],
    interval_s: float | None = None,
    progress: Callable[[float], object] | None = None,
) -> Run:
    """Pour once and judge the pour.

    Parameters
    ----------
    config : mapping
        The whole configuration.
    parameters : mapping
        The six contact parameters by name.
    seed : int
        Of the berries' places and sizes.
    particle : Particle
        The berry's body.
    berry : mapping
        What the verb ``berry`` writes.
    interval_s : float, optional
        Simulated time between two frames of a film; none without it.
    progress : callable, optional
        Called with the simulated time [s].

    Returns
    -------
    Run
        Its status is one of `STATUSES`; ``no_flank`` comes with the measurement.
    """
    poured = pour(config, parameters, seed, particle, berry, interval_s, progress)
    status, reason = status_of(poured, config)
    record = {
        "seed": int(seed),
        "status": status,
        "reason": reason,
        "discharge_s": poured.discharge_s if np.isfinite(poured.discharge_s) else None,
        "berries_on_plate": int(poured.on_plate.sum()),
        "berries_in_pile": int(poured.in_pile.sum()),
        "berries_off_plate": poured.off_plate,
        "kinetic_energy_J": poured.kinetic_energy_j if np.isfinite(poured.kinetic_energy_j) else None,
    }
    # in single precision: 0.03 um at the edge of the plate
    arrays = {
        "position": poured.centres_m.astype(np.float32),
        "quaternion": poured.quaternions.astype(np.float32),
        "in_pile": poured.in_pile,
        "scale": np.asarray(poured.scales, np.float32),
    }
    return Run(record, arrays, poured.frames)


# --- measure --------------------------------------------------------------------------------------


def measure(
    record: Mapping[str, Any],
    arrays: Mapping[str, np.ndarray],
    config: Mapping[str, Any],
    particle: "Particle",
    berry: Mapping[str, Any],
) -> dict[str, Any]:
    """The measured run: the record of a pour with every response of its pile.

    Parameters
    ----------
    record : mapping
        That of the `Run`.
    arrays : mapping
        ``position``, ``quaternion``, ``in_pile`` and, where berries differ in size, ``scale``.
    config : mapping
        The whole configuration.
    particle : Particle
    berry : mapping
        With the mean axes ``long_mm``, ``major_mm``, ``minor_mm``.

    Returns
    -------
    dict
        `ALWAYS`, and the other responses that are targets. Numbers are None where there is no pile to measure. A pile
        that lacks a target gets the status ``no_flank`` and keeps what could be measured.
    """
    from repose.measure.pile import MeasureSettings
    from repose.measure.saved_piles import pile_responses

    settings = MeasureSettings.of(config["measure"], berry)
    wanted = [one.name for one in BENCH.wanted(config)]
    more = [name for name in wanted if name not in ALWAYS and name not in record]
    judged = {key: record[key] for key in ("seed", "status", "reason")}
    measured = dict.fromkeys((*ALWAYS, *more))
    if record["status"] == "ok":
        plate_mm = config[NAME]["plate_diameter_mm"]
        found, reasons = pile_responses(arrays, particle, settings, plate_mm, more)
        measured |= found
        for name in wanted:
            if measured.get(name, record.get(name)) is None:
                judged |= {"status": "no_flank", "reason": reasons.get(name, f"{name} cannot be measured")}
                break
    return judged | measured | {key: value for key, value in record.items() if key not in judged}


BENCH = register(
    BenchTest(
        name=NAME,
        responses=RESPONSES,
        recorded=RECORDED,
        statuses=STATUSES,
        settings=Settings,
        build=build,
        run=run,
        measure=measure,
        duration_s=lambda config: config[NAME]["duration_s"],
        contradictions=contradictions,
        misfits=misfits,
        advice=funnel_advice.sentences,
        kept=("position", "quaternion", "in_pile"),
        in_words="angle of repose {aor_deg:.2f} deg, Height {height_mm:.1f} mm, "
        "{berries_on_plate} berries on the plate",
    )
)
