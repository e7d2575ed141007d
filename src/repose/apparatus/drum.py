"""The rotating drum (paper, section 4.2.2): berries rest in a cylinder that then turns until its bed slips.

The axis is y, the origin lies on it half-way along. The drum turns about -y, which carries the bed towards +x. When a
slip is judged the drum stops, as in the experiment, and the bed comes to rest.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import Field

from repose.apparatus.bench_test import BenchTest, Run, register
from repose.apparatus.settings import SimulationSettings
from repose.core.responses import Response
from repose.core.runs import Recorded
from repose.core.section import Berries, Section, Seeds

if TYPE_CHECKING:
    from repose import dem
    from repose.apparatus.drum_rotation import Rotation
    from repose.particle.particle import Particle

NAME = "drum"
STATUSES = ("ok", "unstable", "lost", "not_at_rest", "no_slip", "no_surface")

# --- what it gives --------------------------------------------------------------------------------

# How the surface of the bed is seen, and what counts as a slip.
SEEN = ("measure.mm_per_pixel", "drum.fit_share", "drum.slip_drop_deg")
RESPONSES = (
    Response(
        "drum_slip_deg",
        "deg",
        "drum, slip",
        "slip",
        NAME,
        -90.0,
        90.0,
        SEEN,
        lambda run: run.get("before_surface_deg"),
    ),
    Response(
        "drum_rest_deg",
        "deg",
        "drum, after the slip",
        "rest",
        NAME,
        -90.0,
        90.0,
        SEEN,
        lambda run: run.get("after_surface_deg"),
    ),
)
RECORDED = Recorded(means=tuple(one.name for one in RESPONSES), single=tuple(one.name for one in RESPONSES))

# --- what its configuration asks ------------------------------------------------------------------


class Settings(Section):
    """The section `drum` of the configuration; config/README.md explains its keys."""

    berries: Berries
    rate_per_s: float = Field(ge=0.1, le=10000)
    rotate_from_s: float = Field(ge=0.1, le=600)
    angular_velocity_rad_s: float = Field(ge=1.0e-4, le=10)
    report_s: float = Field(ge=0.1, le=600)
    longest_rotation_s: float = Field(ge=0.1, le=600)
    settle_s: float = Field(ge=0, le=100)
    seeds: Seeds
    outer_diameter_mm: float = Field(ge=20, le=5000)
    wall_thickness_mm: float = Field(gt=0, le=1000)
    length_mm: float = Field(ge=10, le=5000)
    factory_height_mm: float = Field(ge=-2000, le=2000)
    record_s: float = Field(ge=0.001, le=10)
    slip_drop_deg: float = Field(ge=0.05, le=45)
    fit_share: float = Field(ge=0.1, le=1)
    depth_bin_mm: float = Field(ge=0.5, le=500)


def contradictions(config: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Keys of a drum that cannot run, and what is allowed.

    Refused are a drum without room, a rotation before the last berry is there, and a record finer than the
    time steps.

    Parameters
    ----------
    config : mapping
        The whole configuration.

    Yields
    ------
    key, allowed : str
        Dotted key, and what it may be.
    """
    from repose.apparatus import drum_geometry

    yield from drum_geometry.contradictions(config, NAME)
    section = config[NAME]
    if section["report_s"] < section["rotate_from_s"]:
        yield f"{NAME}.report_s", f"at least {NAME}.rotate_from_s, {section['rotate_from_s']:g}"


def misfits(
    config: Mapping[str, Any], axes_mm: Sequence[float], section: str = NAME
) -> Iterator[tuple[str, str]]:
    """Keys of a drum in which a mean berry cannot lie across the axis at the factory's height.

    Parameters
    ----------
    config : mapping
        The whole configuration.
    axes_mm : sequence of float, (3,)
        Mean axes of the berry, the longest first.
    section : str, optional
        Of the configuration, that describes the drum.

    Yields
    ------
    key, allowed : str
        Dotted key, and what it may be.
    """
    drum, long_mm = config[section], max(axes_mm)
    highest = drum["outer_diameter_mm"] / 2 - drum["wall_thickness_mm"] - long_mm / 2
    if drum["length_mm"] <= long_mm:
        yield f"{section}.length_mm", f"above {long_mm:.4g}, so that a mean berry fits"
    if abs(drum["factory_height_mm"]) >= highest:
        room = f"between -{highest:.4g} and {highest:.4g}" if highest > 0 else "a wider drum"
        yield f"{section}.factory_height_mm", f"{room}, so that a mean berry fits"


# --- build and run --------------------------------------------------------------------------------


def build(
    config: Mapping[str, Any],
    parameters: Mapping[str, float],
    particle: "Particle",
    berry: Mapping[str, Any],
    largest_scale: float = 1.0,
) -> "dem.Simulation":
    """The empty simulation of the drum.

    Parameters
    ----------
    config, parameters, particle, berry, largest_scale
        As in `BenchTest.build`.

    Returns
    -------
    repose.dem.Simulation
    """
    from repose.apparatus import drum_rotation

    return drum_rotation.build(config, parameters, particle, berry, largest_scale)


def status_of(rotation: "Rotation", config: Mapping[str, Any]) -> tuple[str, str]:
    """Status and reason of a run, before it is measured.

    Parameters
    ----------
    rotation : Rotation
    config : mapping

    Returns
    -------
    status : str
        One of `STATUSES`, but ``no_surface``, which the measurement finds.
    reason : str
    """
    if rotation.unstable:
        return "unstable", rotation.unstable
    if not rotation.held:
        return "lost", "a berry is missing, or outside the drum"
    if rotation.rest_energy_j > SimulationSettings.of(config).rest_energy_j:
        return "not_at_rest", f"kinetic energy {rotation.rest_energy_j:.2e} J a berry when the rotation began"
    if rotation.slip is None:
        fall, last = config[NAME]["slip_drop_deg"], rotation.record["time_s"][-1]
        return "no_slip", f"the bed's centre of mass never fell by {fall:g} degrees in {last:g} s"
    return "ok", ""


def run(
    config: Mapping[str, Any],
    parameters: Mapping[str, float],
    seed: int,
    particle: "Particle",
    berry: Mapping[str, Any],
    interval_s: float | None = None,
    progress: Callable[[float], object] | None = None,
) -> Run:
    """Fill and turn once.

    The arrays are the columns of the record and the states: ``position_STATE`` (N, 3) [m], ``quaternion_STATE`` (N, 4)
    and ``turned_STATE_deg`` for start, report, before and after.

    Parameters
    ----------
    config, parameters, seed, particle, berry, progress
        As in `BenchTest.run`.
    interval_s : float, optional
        Asks for frames; they are those of the record.

    Returns
    -------
    Run
    """
    from repose.apparatus.drum_rotation import RECORD, rotate

    rotation = rotate(config, parameters, seed, particle, berry, progress)
    status, reason = status_of(rotation, config)
    record: dict[str, Any] = {
        "seed": int(seed),
        "status": status,
        "reason": reason,
        "rotation_from_s": rotation.rotation_from_s,
    }
    if status in ("ok", "no_slip"):
        for state, row in rotation.rows().items():
            record |= {f"{state}_{key}": float(rotation.record[key][row]) for key in RECORD}
    if status == "ok" and rotation.slip is not None:
        energy = rotation.record["energy_j"][rotation.slip.begins : rotation.slip.ends + 1]
        record |= {
            "bed_drop_deg": record["before_bed_deg"] - record["after_bed_deg"],
            "slip_duration_s": record["after_time_s"] - record["before_time_s"],
            "largest_energy_j": float(energy.max()),
        }
    position, quaternion = rotation.centres_m, rotation.quaternions
    arrays = {"scale": rotation.scales, **rotation.record}
    for state, row in rotation.rows().items() if len(position) else ():
        arrays |= {f"position_{state}": position[row], f"quaternion_{state}": quaternion[row]}
        arrays[f"turned_{state}_deg"] = rotation.record["turned_deg"][row]
    if interval_s is None:
        return Run(record, arrays)
    return Run(record, arrays, {"position": position, "quaternion": quaternion, **arrays})


# --- measure --------------------------------------------------------------------------------------


def measure(
    record: Mapping[str, Any],
    arrays: Mapping[str, np.ndarray],
    config: Mapping[str, Any],
    particle: "Particle",
    berry: Mapping[str, Any],
) -> dict[str, Any]:
    """The measured run: what `repose.apparatus.drum_surface.of_run` finds, and the responses, which it names otherwise.

    Parameters
    ----------
    record, arrays, config, particle, berry
        As in `BenchTest.measure`.

    Returns
    -------
    dict
    """
    from repose.apparatus import drum_surface

    measured, _ = drum_surface.of_run(record, arrays, config, particle)
    ok = measured["status"] == "ok"
    return measured | {one.name: one.of(measured) if ok else None for one in RESPONSES}


def longest_s(config: Mapping[str, Any]) -> float:
    """Longest simulated time of a run.

    Parameters
    ----------
    config : mapping

    Returns
    -------
    float
        Seconds.
    """
    section = config[NAME]
    return section["rotate_from_s"] + section["longest_rotation_s"] + section["settle_s"]


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
        duration_s=longest_s,
        contradictions=contradictions,
        misfits=misfits,
        measured_by=("fit_share", "depth_bin_mm"),
        in_words="first slip after {before_time_s:.1f} s, {before_turned_deg:.1f} deg; "
        "surface {before_surface_deg:.1f} deg before, {after_surface_deg:.1f} deg after it",
    )
)
