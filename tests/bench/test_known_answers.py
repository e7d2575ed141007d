"""Every bench test with every rolling law and kind of grain gives the answer that theory gives without our code.

Grains of some 10 mm are poured with friction, and without, when nothing stands. A law under which grains creep
(`constant_torque`) is refused where a body must be held; elsewhere its grains may not come to rest, or flow without a
slip. Takes two minutes once the kernels are compiled; those of the drawdown box, which has meshes, are a selection.
"""

import itertools
import math
from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest
from export.jobs import clump
from goji import BEAD, SPHERE, named, own_example, particle
from refusals import input_error
from shared import BUILT_IN

from repose.bench import Scene, bench
from repose.bench.scene import longest_time_step
from repose.config.pipeline import PipelineConfig
from repose.dem.laws import ROLLING_LAWS
from repose.grain import support_fit
from repose.stages.job import run_once

STATIC = 0.5
ROLLING = 0.2
HIT = 0.5
G = 9.81
RHO = BEAD["density_kg_m3"]
FRICTIONS = ((STATIC, ROLLING), (0.3, 0.05), (0.0, 0.0))
ROUGH, MILD, SMOOTH = (named((0.3, mus, mur, HIT, mus, mur)) for mus, mur in FRICTIONS)
SLIPS = math.degrees(math.atan(STATIC))
ROLLS = math.degrees(math.atan(ROLLING))


@cache
def grain(kind):
    """A grain of some 0.6 cm3: a sphere, an ellipsoid, a sum of two, or three spheres in line."""
    if kind == "smooth":
        axes = 1e-3 * np.array([[5.2, 0.7, 0.7], [2.2, 3.3, 2.8]])
        volume, second = support_fit.volume_integrals(axes)
        mass = RHO * volume
        inertia = RHO * (second.sum() - second)
        reach = support_fit.bounding_radius(axes)
        body = replace(
            SPHERE,
            kind=kind,
            semi_axes_m=axes,
            volume_m3=volume,
            bounding_radius_m=reach,
        )
        return replace(body, mass_kg=mass, inertia_kg_m2=inertia)
    if kind == "clump":
        body = clump(
            [[0.0, 0.0, 0.0, 4.4], [-3.5, 0.0, 0.0, 4.0], [3.5, 0.0, 0.0, 4.0]]
        )
        volume = 6.395e-7
        # about that of an ellipsoid of its axes
        inertia = 0.2e-6 * RHO * volume * np.array([32.0, 71.0, 71.0])
        return replace(
            body,
            density_kg_m3=RHO,
            volume_m3=volume,
            mass_kg=RHO * volume,
            inertia_kg_m2=inertia,
        )
    return SPHERE if kind == "sphere" else particle((14.0, 9.0, 8.0), RHO)


def configured(name, law):
    settings = own_example(name)
    settings["simulation"] |= {
        "rolling_law": law,
        "time_step_s": 1.5e-4,
        "rest_energy_j": 1e-8,
    }
    settings["measure"] |= {"views": 4}
    return settings


def ran(name, law, kind, values):
    """One run: its record with its arrays. With friction it is good, unless the law lets grains creep."""
    scene = Scene.of(configured(name, law), values, BEAD, grain(kind), 1)
    if name == "drop_test":
        scene = replace(scene, grain=BEAD | {"shear_modulus_pa": 1e10})
        scene.settings.config["simulation"]["time_step_s"] = (
            0.25 * longest_time_step(scene).time_step_s
        )
        scene = Scene.of(scene.settings.config, values, scene.grain, scene.particle, 1)
    record, run = run_once(bench(name), scene)
    flows = ("no_slip",) if name == "drum" else ()  # a bed may also flow down evenly
    creeps = ("not_at_rest",) if ROLLING_LAWS.entry(law).creeps else ()
    assert values is SMOOTH or record["status"] in ("ok", *flows, *creeps), record[
        "reason"
    ]
    return record | run.arrays


def plane(kind, rough, smooth):
    """A sled slides at atan(mu_s), a sphere rolls at atan(mu_r), no other grain before; all at 0 without friction."""
    expected = [SLIPS, 0.0]
    assert [rough["slip_deg"], smooth["slip_deg"]] == pytest.approx(expected, abs=0.05)
    assert kind != "sphere" or rough["roll_deg"] == pytest.approx(ROLLS, abs=0.05)
    assert rough["roll_deg"] is None or ROLLS - 0.05 < rough["roll_deg"] < SLIPS + 0.05


def drop(_kind, rough):
    """Upright, the hit goes through the centre: e by height and by sound, and e^2 of the height."""
    assert [rough["height_restitution"], rough["sound_restitution"]] == pytest.approx(
        [HIT, HIT], abs=0.003
    )
    assert rough["rebound_height_mm"] == pytest.approx(100.0 * HIT**2, rel=0.015)


def filled(kind, *runs):
    """What lies below the rim over the volume; as solid as grains can lie, and the more so without friction."""
    solid = []
    for run in runs:
        x, y, z = run["position"].T
        assert len(z) == 120
        assert (np.hypot(x, y) < 0.025).all()
        assert z.min() > 0.0
        solid.append(
            (z < 0.03).sum() * grain(kind).volume_m3 / (math.pi * 0.025**2 * 0.03)
        )
        assert run["bulk_density_kg_m3"] in (None, pytest.approx(solid[-1] * RHO))
    assert 0.45 < solid[0] < solid[1] < 0.74


def emptied(kind, *runs):
    """All flow out, none before it can have fallen; within 3 of Beverloo's rate, below Torricelli's; smooth first."""
    ends = []
    for run in runs:
        exits = np.sort(run["exit_s"])
        top = run["position"][:, 2].max()
        ends.append(exits[-1])
        assert run["berries_out"] == 120
        assert len(exits) == 120
        assert math.sqrt(2.0 * top / G) < ends[-1]
        # from the grain with which a fifth is out to that with which four fifths are; rounding may take the next one
        rates = [
            (72 + b - a) * grain(kind).mass_kg / (exits[95 + b] - exits[23 + a])
            for a in (0, 1)
            for b in (0, 1)
        ]
        rate = rates[0]
        assert run["flow_g_s"] in (
            None,
            *(pytest.approx(1e3 * possible_rate, rel=1e-9) for possible_rate in rates),
        )
        beverloo = 0.58 * 0.6 * RHO * math.sqrt(G) * (0.06 - 1.4 * 0.01) ** 2.5
        assert (
            beverloo / 3.0
            < rate
            < RHO * math.pi / 4 * 0.06**2 * math.sqrt(2.0 * G * top)
        )
    assert ends[1] < ends[0]


def pile(angle, height, kind, rough, smooth):
    """Every grain is there, on a slope above that on which it rolls; without friction a layer, and no angle."""
    reach = 1e3 * grain(kind).bounding_radius_m
    assert len(rough["position"]) == 150
    if rough["status"] == "ok":
        assert ROLLS < rough[angle] < 45.0
        assert (
            0.0
            < rough[height] - 1e3 * rough["position"][rough["in_pile"]][:, 2].max()
            < 1.001 * reach
        )
    assert smooth["status"] != "ok"
    assert smooth[angle] is None
    assert 1e3 * smooth["position"][:, 2].max() < 1.05 * reach


def drained(kind, mild, smooth):
    """What drained and what stayed is what was filled in, on slopes; without friction more drains."""
    left = np.isfinite(mild["exit_s"])
    z = mild["position"][:, 2]
    assert len(z) == 150
    assert z[left].max() < 0.09 < z[~left].min()
    if mild["status"] == "ok":
        expected = 1e3 * grain(kind).mass_kg * left.sum()
        assert mild["drawdown_mass_g"] == pytest.approx(expected)
        assert math.degrees(0.05) < mild["drawdown_above_deg"] < 60.0
    assert np.isfinite(smooth["exit_s"]).sum() > left.sum()


def turned(response, _kind, mild, smooth):
    """Friction lifts the bed above the slope on which a grain rolls; without it the surface is level."""
    assert mild["status"] != "ok" or math.degrees(0.05) < mild[response] < 60.0
    # nothing damps its swing
    assert smooth["status"] in ("ok", "no_slip", "not_at_rest"), smooth["reason"]
    assert abs(smooth[response] or 0.0) < 8.0


# what is checked, and the frictions of its runs
ANSWERS = {
    "inclined_plane": (plane, ROUGH, SMOOTH),
    "drop_test": (drop, ROUGH),
    "cylinder": (filled, ROUGH, SMOOTH),
    "discharge": (emptied, MILD, SMOOTH),
    "funnel": (partial(pile, "aor_deg", "height_mm"), ROUGH, SMOOTH),
    "lifted_cylinder": (
        partial(pile, "lifted_aor_deg", "lifted_height_mm"),
        ROUGH,
        SMOOTH,
    ),
    "drawdown": (drained, MILD, SMOOTH),
    "drum": (partial(turned, "drum_slip_deg"), MILD, SMOOTH),
    "turning": (partial(turned, "turning_deg"), MILD, SMOOTH),
}
LAWS = tuple(ROLLING_LAWS)
GRAINS = ("sphere", "ellipsoid", "smooth", "clump")
CASES = itertools.product(ANSWERS, LAWS, GRAINS)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "law", "kind"),
    [
        of
        for of in CASES
        if of[0] != "drawdown" or of[1] == "budget" or of[2] == "sphere"
    ],
)
def test_a_bench_test_gives_the_known_answer(name, law, kind):
    if name == "inclined_plane" and ROLLING_LAWS.entry(law).creeps:
        input_error(
            r"simulation\.rolling_law.*lets it creep",
            PipelineConfig.of,
            configured(name, law),
        )
        return
    check, *frictions = ANSWERS[name]
    check(kind, *(ran(name, law, kind, values) for values in frictions))


def test_every_built_in_bench_test_has_its_answer():
    assert set(BUILT_IN) <= set(ANSWERS)
    assert {"budget", "constant_torque", "epsd", "epsd2"} <= set(LAWS)
