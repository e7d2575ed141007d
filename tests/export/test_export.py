"""Decks of other programs: they hold the study's numbers, and what stands for a law of ours does what ours does."""

import ast
import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from export.jobs import BALL, BERRY, CONFIG, MM, SKEW, THREE, job_of
from known import is_known
from refusals import input_error
from scipy.integrate import solve_ivp
from shared import ROOT, says

from repose import export
from repose.bench.scene import materials_of
from repose.bench.space import contact_space
from repose.config import dependencies
from repose.config.pipeline import PipelineConfig
from repose.dem.laws import CONTACT_LAWS, ROLLING_LAWS
from repose.export import edem, laws, surface, yade
from repose.export.job import average_over_surface, make_job
from repose.export.lammps import (
    TSUJI_COEFFICIENTS,
    compute_restitutions,
    format_contact_law,
)
from repose.export.laws import compute_rolling_coefficient
from repose.export.liggghts import MIN_RESTITUTION, find_prime
from repose.stages import card_study

DECK = {
    "liggghts": "in.pour",
    "lammps": "in.pour",
    "yade": "pour.py",
}
SMOOTH = replace(
    THREE,
    kind="smooth",
    spheres_m=np.zeros((0, 4)),
    semi_axes_m=MM * np.array([[8.0, 5.5, 5.5]]),
)


@pytest.fixture(scope="module")
def config():
    return PipelineConfig.load(CONFIG).config


@pytest.fixture(scope="module")
def job(config):
    return make_job(
        config, contact_space(config["parameters"]).centre, THREE, BERRY, seed=3
    )


@pytest.mark.parametrize("program", export.PROGRAMS)
def test_the_decks_of_a_clump_and_a_ball_are_known(config, program):
    decks = [
        export.PROGRAMS[program](job_of(config, particle)) for particle in (THREE, BALL)
    ]
    texts = [
        text
        for deck in decks
        for name, text in deck.items()
        if not name.endswith(".stl")
    ]
    is_known(f"{program}.txt", re.sub(r".*(version|commit).*", "", "\n".join(texts)))


def test_liggghts_gets_the_frictions_and_the_duration(job):
    deck = export.PROGRAMS["liggghts"](job)["in.pour"]
    written = re.search(r"coefficientFriction peratomtypepair 2 (.*)", deck)[1].split()
    frictions = [job.grains.static_friction, job.on_wall.static_friction]
    assert [float(word) for word in written[:2]] == pytest.approx(frictions)
    steps = int(re.search(r"\nrun +(\d+)", deck).group(1))
    step = float(re.search(r"timestep +(\S+)", deck).group(1))
    assert steps * step == pytest.approx(job.funnel.duration_s, rel=1e-3)


def test_lammps_gets_the_moduli_of_the_pair_and_half_the_critical_dashpot(job):
    # two surfaces of this E and nu have the pair's E*; the tangential stiffness is 8 G*
    keywords = format_contact_law(job, job.on_wall).split()
    young = float(keywords[1])
    poisson = float(keywords[3])
    expected = job.on_wall.effective_young_pa
    assert young / (2 * (1 - poisson**2)) == pytest.approx(expected)
    assert float(keywords[6]) == pytest.approx(8 * job.on_wall.effective_shear_pa)
    spring, dashpot = map(float, keywords[keywords.index("sds") + 1 :][:2])
    assert dashpot == pytest.approx(0.5 * math.sqrt(spring * job.particle.mass_kg))


def test_yade_gets_the_spheres_the_mass_and_the_funnel(job):
    tree = ast.parse(export.PROGRAMS["yade"](job)["pour.py"])
    assigned = {
        ast.unparse(node.targets[0]): node.value
        for node in tree.body
        if isinstance(node, ast.Assign)
    }
    spheres = ast.literal_eval(assigned["SPHERES"])
    mass = ast.literal_eval(assigned["MASS"])
    rings = ast.literal_eval(assigned["RINGS"])
    assert np.array(spheres) == pytest.approx(job.particle.spheres_m)
    assert mass == pytest.approx(job.particle.mass_kg)
    assert np.array(rings) == pytest.approx(surface.compute_profile(job.surfaces))


def test_the_table_of_edem_has_values_with_units(config):
    study = PipelineConfig.load(CONFIG)
    scene = study.scene(study.parameters.centre, 1)
    rows = edem.list_table_rows(
        materials_of(scene),
        scene.parameters,
        THREE,
        scene.simulation,
        study.settings.funnel,
        time_step_s=1e-4,
    )
    table = {row.name: row for row in rows}
    assert len(table) == len(rows)
    assert table["Mass of a grain"] == ("Mass of a grain", THREE.mass_kg, "kg")
    friction = table["Coefficient of static friction, grain-wall"]
    assert friction.value == scene.parameters["mus_gp"]
    assert table["Fixed time step"].value == 1e-4
    assert all(math.isfinite(row.value) for row in rows)


def test_liggghts_primes_and_takes_the_facets_around_the_funnel_as_one_face(job):
    primes = [find_prime(seed) for seed in range(200)]
    assert len(set(primes)) == 200
    assert min(primes) > 10000
    assert all(all(p % k for k in range(2, 200)) for p in primes)
    angle = re.search(
        r"curvature (\S+) curvature_tolerant yes",
        export.PROGRAMS["liggghts"](job)["in.pour"],
    ).group(1)
    assert 360 / surface.N_FACETS < float(angle) < surface.LARGEST_ARC_DEG / 2


def test_no_deck_has_a_dashpot_along_the_tangent_and_the_plate_is_the_configured_one(
    job, config
):
    # where the program has one, Coulomb's limit does not hold it
    files = {
        program: export.PROGRAMS[program](job)
        for program in ("liggghts", "lammps", "yade")
    }
    laws = re.findall(r"model hertz .*", files["liggghts"]["in.pour"])
    assert [law.endswith("tangential_damping off") for law in laws] == [True] * 3
    assert (
        re.findall(r"tangential mindlin\S* \S+ (\S+)", files["lammps"]["in.pour"])
        == ["0"] * 3
    )
    assert "betas=by_pair(0.0, 0.0)" in files["yade"]["pour.py"]
    expected = 0.5e-3 * config["funnel"]["plate_diameter_mm"]
    assert job.plate_radius_m == pytest.approx(expected)
    for program, name in DECK.items():
        if program != "yade":  # its plate is a box under all of the scene
            assert f"{job.plate_radius_m:.6g}" in export.PROGRAMS[program](job)[name], (
                program
            )


def test_a_sphere_is_exported_with_its_volume_mass_and_step(config):
    round_grain = replace(SMOOTH, kind="ellipsoid", semi_axes_m=np.full((1, 3), 5 * MM))
    of_clump = job_of(config, THREE)
    of_sphere = job_of(config, BALL)
    of_ellipsoid = job_of(config, round_grain)
    step = config["simulation"]["time_step_s"]
    half = float(f"{0.5 * step:.2g}")
    assert of_clump.time_step_s == half
    assert of_sphere.time_step_s == half
    assert of_ellipsoid.time_step_s == half
    expected = np.array([[0.0, 0.0, 0.0, 5 * MM]])
    assert of_sphere.particle.spheres_m == pytest.approx(expected)
    volume = 4 / 3 * math.pi * (5 * MM) ** 3
    assert (
        of_sphere.particle.density_kg_m3 * volume
        == pytest.approx(of_sphere.particle.mass_kg)
        == BALL.mass_kg
    )
    root = math.sqrt(BALL.mass_kg / volume / BERRY["shear_modulus_pa"])
    expected = math.pi * 5 * MM * root / (0.1631 * 0.32 + 0.8766)
    assert of_sphere.rayleigh_s == pytest.approx(expected)
    of_ball = np.full(3, 0.4 * of_sphere.particle.mass_kg * (5 * MM) ** 2)
    assert of_sphere.particle.inertia_kg_m2 == pytest.approx(of_ball)


def test_a_card_of_an_earlier_version_has_the_inertia_of_a_sphere():
    grain = {
        "shape": "multisphere",
        "ellipsoids_mm": [],
        "spheres_mm": [[0, 0, 0, 5]],
        "density_kg_m3": 1000.0,
    }
    of_card = card_study.rebuild_particle(
        {"grain": grain | {"mass_g": 2.0, "volume_mm3": 2000.0}}, None, "old.json"
    )
    assert of_card.inertia_kg_m2 == pytest.approx(np.full(3, 0.4 * 2e-3 * 5e-3**2)), (
        "cards of earlier versions"
    )


def test_a_deck_of_a_sphere_has_no_clumps(config):
    of_clump = job_of(config, THREE)
    of_sphere = job_of(config, BALL)
    for program in DECK:
        text = "".join(export.PROGRAMS[program](of_sphere).values())
        assert not re.search(
            r"multisphere|rigid|clump\.txt|\.clump\(|each pair of spheres",
            text,
        )
        assert "the study's grain has that of its mesh" in text
        deck = export.PROGRAMS[program](of_clump)[DECK[program]]
        assert re.search(r"multisphere|rigid|\.clump\(", deck)
    text = export.PROGRAMS["liggghts"](of_sphere)["in.pour"]
    assert re.search(r"particletemplate/sphere .* radius constant 0.005\n", text)


def test_a_grain_is_exported_as_the_sphere_of_its_volume(config):
    job = make_job(
        config,
        contact_space(config["parameters"]).centre,
        SMOOTH,
        BERRY,
        one_sphere=True,
    )
    volume = SMOOTH.mass_kg / SMOOTH.density_kg_m3
    assert 4 / 3 * math.pi * job.particle.spheres_m[0, 3] ** 3 == pytest.approx(volume)
    assert job.is_sphere
    assert job.particle.mass_kg == SMOOTH.mass_kg
    assert job.particle.density_kg_m3 == pytest.approx(840.47)
    for deck in export.PROGRAMS.values():
        assert "every grain is the sphere of its volume, radius 7.0" in next(
            iter(deck(job).values())
        )


def test_a_deck_begins_with_its_versions_and_the_page_has_them(job):
    page = (ROOT / "docs" / "export.md").read_text()
    for program, name in zip(DECK, ("LIGGGHTS", "LAMMPS", "YADE"), strict=True):
        first = next(iter(export.PROGRAMS[program](job).values())).splitlines()[0]
        row = next(line for line in page.splitlines() if line.startswith(f"| {name}"))
        assert name in first
        for version in re.findall(r"\d+ \w{3} \d{4}|\d+\.\d[\w.]*", first):
            assert version.rstrip(".:") in row


@pytest.mark.parametrize("restitution", [0.2, 0.5, 1.0])
def test_the_number_of_older_lammps_gives_the_same_damping(config, restitution):
    job = job_of(config, THREE, e_gg=restitution)
    number = compute_restitutions(job)["tsuji_gg"]
    expected = math.sqrt(5) * job.grains.damping_ratio
    assert np.polyval(TSUJI_COEFFICIENTS, number) == pytest.approx(expected, abs=1e-9)
    assert number < 1.01


@pytest.mark.parametrize("particle", [THREE, SKEW], ids=["three", "skew"])
def test_the_members_of_a_yade_clump_have_mass_centre_and_moments_of_the_body(
    config, particle
):
    job = job_of(config, particle)
    weights, member_masses = yade.distribute_mass(job)
    masses = weights * job.particle.mass_kg
    places = job.particle.spheres_m[:, :3]
    assert masses.sum() == pytest.approx(job.particle.mass_kg)
    assert masses @ places == pytest.approx(np.zeros(3), abs=1e-12)
    tensor = np.diag(member_masses * len(places))
    for mass, x in zip(masses, places, strict=True):
        tensor += mass * (x @ x * np.eye(3) - np.outer(x, x))
    assert tensor == pytest.approx(np.diag(job.particle.inertia_kg_m2), abs=1e-14)
    assert np.all(member_masses > 0)


def rebound(ratio, limited):
    """Speed after an impact at speed 1 by Hertz's law with Tsuji's damping; mass and 4/3 E* sqrt(R*) are 1."""

    def slopes(_, state):
        overlap, speed = state
        root = math.sqrt(max(overlap, 0.0))
        force = root**3 + 2 * math.sqrt(5 / 6) * ratio * math.sqrt(1.5 * root) * speed
        return speed, -max(force, 0.0) if limited else -force

    def parted(_, state):
        return state[0]

    parted.terminal = True
    parted.direction = -1
    return -solve_ivp(
        slopes, (0, 50), (1e-9, 1.0), events=parted, rtol=1e-8, atol=1e-12
    ).y[1, -1]


@pytest.mark.parametrize(("tension", "limited"), [("keep", False), ("release", True)])
@pytest.mark.parametrize("restitution", [0.35, 0.7])
def test_the_equivalent_restitution_gives_the_calibrated_rebound(
    config, job, tension, limited, restitution
):
    config = config | {"simulation": config["simulation"] | {"tension": tension}}
    values = contact_space(config["parameters"]).centre | {"e_gp": restitution}
    typed = laws.compute_equivalent_restitution(
        make_job(config, values, THREE, BERRY).on_wall
    )
    # the formula of the other programs
    ratio = -math.log(typed) / math.hypot(math.log(typed), math.pi)
    assert rebound(ratio, limited) == pytest.approx(restitution, abs=1e-3)
    assert (typed == pytest.approx(restitution)) == (tension == "keep")


def test_a_damping_that_liggghts_cannot_take_is_reported(job):
    strong = replace(job, grains=replace(job.grains, damping_ratio=1.2))
    assert (
        laws.compute_equivalent_restitution(strong.grains, MIN_RESTITUTION)
        == MIN_RESTITUTION
    )
    assert MIN_RESTITUTION > 0.05  # the program asks for more than that
    assert (
        "stronger than coefficientRestitution"
        in export.PROGRAMS["liggghts"](strong)["in.pour"]
    )


def test_a_sphere_rolls_with_the_calibrated_coefficient_on_a_wall(job):
    radius, lever = average_over_surface(np.array([[0.0, 0.0, 0.0, 0.005]]))
    assert radius == pytest.approx(0.005)
    assert lever == pytest.approx(0.005)
    sphere = replace(
        job, lever_m=lever, on_wall=replace(job.on_wall, effective_radius_m=radius)
    )
    expected = job.on_wall.rolling_friction
    assert laws.compute_rolling_coefficient(sphere, sphere.on_wall) == pytest.approx(
        expected
    )
    # the same torque needs twice the coefficient
    longer = replace(sphere, lever_m=2 * lever)
    expected = 2 * job.on_wall.rolling_friction
    assert laws.compute_rolling_coefficient(longer, longer.on_wall) == pytest.approx(
        expected
    )


def test_free_surface_of_two_spheres_that_overlap():
    # of each sphere a cap of height R / 2 is hidden
    radius, lever = average_over_surface(
        np.array([[-0.5, 0.0, 0.0, 1.0], [0.5, 0.0, 0.0, 1.0]]), 20000
    )
    # places on a sphere are even along its axis
    outwards = np.linspace(-0.5, 1.0, 200001)
    assert radius == pytest.approx(1.0)
    assert lever == pytest.approx(np.sqrt(1.25 + outwards).mean(), rel=1e-3)


def test_the_funnel_is_the_simulated_one(job):
    line = surface.compute_profile(job.surfaces)
    funnel = job.surfaces
    expected = [0.5 * funnel.inlet_diameter_m, funnel.inlet_height_m]
    assert line[0] == pytest.approx(expected)
    assert line[:, 0].min() == pytest.approx(0.5 * funnel.outlet_diameter_m)
    cone = funnel.cone_line()
    on_cone = np.abs(line @ [cone.normal_r, cone.normal_z] - cone.offset) < 1e-9
    assert line[on_cone][-1] @ [cone.up_r, cone.up_z] == pytest.approx(cone.first)
    corners = surface.divide_surface(funnel)
    areas = 0.5 * np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    assert areas.min() > 0.0
    lengths = np.linalg.norm(np.diff(line, axis=0), axis=1)
    middles = 0.5 * (line[1:, 0] + line[:-1, 0])
    # circumference of the polygon whose corners lie on the unit circle
    around = 2 * surface.N_FACETS * math.sin(math.pi / surface.N_FACETS)
    assert areas.sum() == pytest.approx(around * (lengths * middles).sum(), rel=1e-3)


def test_the_lammps_cone_ends_where_the_funnel_does(job):
    deck = export.PROGRAMS["lammps"](job)["in.pour"]
    line = surface.compute_profile(job.surfaces)
    (ends,) = re.findall(r"region\s+\S+ cone z 0 0 (\S+) (\S+) (\S+) (\S+)", deck)
    low_radius, high_radius, low, high = map(float, ends)
    assert [high_radius, high] == pytest.approx(line[0], rel=1e-6)
    assert np.hypot(*(line - [low_radius, low]).T).min() < 1e-6


def test_a_tube_stands_in_surface_and_deck(config):
    config = config | {
        "funnel": config["funnel"] | {"tube_length_mm": 20.0, "plate_diameter_mm": 80.0}
    }
    job = job_of(config, THREE)
    line = surface.compute_profile(job.surfaces)
    assert np.ptp(
        line[np.isclose(line[:, 0], 0.5 * job.surfaces.outlet_diameter_m)][:, 1]
    ) == pytest.approx(0.02)
    deck = export.PROGRAMS["lammps"](job)["in.pour"]
    assert "region          tube cylinder" in deck
    # the inlet is wider than the plate
    half = float(re.search(r"domain block \S+ (\S+)", deck).group(1))
    expected = 0.5 * job.surfaces.inlet_diameter_m + 4 * job.particle.bounding_radius_m
    assert half == pytest.approx(expected, rel=1e-6)


def test_other_particles_and_laws_are_refused(config):
    centre = contact_space(config["parameters"]).centre
    input_error(
        "^particle: kind is 'smooth'; expected multisphere",
        make_job,
        config,
        centre,
        SMOOTH,
        BERRY,
    )
    linear = config | {
        "simulation": config["simulation"] | {"contact_law": "linear_spring"}
    }
    input_error(
        "hertz_mindlin",
        export.check_laws,
        make_job(linear, centre, THREE, BERRY),
        "yade",
    )


def test_cohesion_is_written(config):
    job = job_of(config, THREE, "jkr", gamma_gg=0.05, gamma_gp=0.02)
    table = export.PROGRAMS["edem"](job)["edem.md"]
    assert "Hertz-Mindlin with JKR" in table
    percent = int(re.search(r"The time step is (\d+) % of the Rayleigh", table)[1])
    assert percent == round(100 * job.time_step_s / job.rayleigh_s) <= 20
    energies = re.findall(r"Surface energy, \S+ \| (\S+) \| J/m2", table)
    assert energies == ["0.1", "0.04"]
    deck = export.PROGRAMS["liggghts"](
        job_of(config, THREE, "sjkr", k_gg=3e4, k_gp=1e4)
    )["in.pour"]
    assert "cohesionEnergyDensity peratomtypepair 2 30000 10000 10000 10000" in deck
    assert (
        len(
            re.findall(
                "model hertz tangential history cohesion sjkr rolling_friction epsd2",
                deck,
            )
        )
        == 3
    )
    assert "cohesion energy density 30000 J/m3 between grains" in deck


@pytest.mark.parametrize(
    ("friction", "expected"),
    [
        ({}, []),
        (
            {"mut_gg": 0.2},
            ["0.2 between grains, 3 pi / 16 mu_s between grain and wall"],
        ),
        (
            {"mut_gp": 0.3},
            ["3 pi / 16 mu_s between grains, 0.3 between grain and wall"],
        ),
    ],
)
def test_twisting_friction_of_either_contact_is_named(config, friction, expected):
    job = job_of(config, THREE, "hertz_mindlin", **friction)
    lines = laws.describe_law_constants(job)
    found = [
        re.search(r": (.*); this input script has none", line)[1] for line in lines
    ]
    assert found == expected


def test_rolling_is_written(config):
    budget = job_of(config, THREE, "hertz_mindlin")
    for law, name in (("constant_torque", "cdt"), ("epsd", "epsd"), ("epsd2", "epsd2")):
        job = job_of(config, THREE, "hertz_mindlin", law)
        deck = export.PROGRAMS["liggghts"](job)["in.pour"]
        assert len(re.findall(rf"rolling_friction {name} ", deck)) == 3
        damping = re.findall(
            r"coefficientRollingViscousDamping peratomtypepair 2 (.*)", deck
        )
        assert damping == (["0.3 0.3 0.3 0.3"] if law == "epsd" else [])
        assert ("two spheres, with a constant torque" in deck) == (
            law == "constant_torque"
        )
        # the lever of two grains is half of one grain's, that on a wall is the same
        expected = 0.5 * compute_rolling_coefficient(budget, budget.grains)
        assert compute_rolling_coefficient(job, job.grains) == expected
        expected = compute_rolling_coefficient(budget, budget.on_wall)
        assert compute_rolling_coefficient(job, job.on_wall) == expected


# What stands for a law in the deck of each program. A pair of program and law that is not here is refused.
CONTACT = {
    ("liggghts", "hertz_mindlin"): "model hertz tangential history rolling_friction",
    (
        "liggghts",
        "hertz_mindlin_rescaled",
    ): "grows and falls with the normal force; in the study it stays as it is",
    (
        "liggghts",
        "sjkr",
    ): "model hertz tangential history cohesion sjkr rolling_friction",
    ("lammps", "hertz_mindlin"): "tangential mindlin ",
    ("lammps", "hertz_mindlin_rescaled"): "tangential mindlin_rescale/force ",
    (
        "yade",
        "hertz_mindlin",
    ): "stays as it is when the normal force changes; in the study it grows and falls",
    (
        "yade",
        "hertz_mindlin_rescaled",
    ): "when the normal force changes; in the study it stays as it is while",
    ("edem", "hertz_mindlin"): "Hertz-Mindlin (no slip)",
    ("edem", "hertz_mindlin_rescaled"): "Hertz-Mindlin (no slip)",
    ("edem", "jkr"): "Hertz-Mindlin with JKR",
}
ROLLING = {
    ("liggghts", "budget"): "rolling_friction epsd2 ",
    ("liggghts", "constant_torque"): "rolling_friction cdt ",
    ("liggghts", "epsd"): "rolling_friction epsd ",
    ("liggghts", "epsd2"): "rolling_friction epsd2 ",
    ("lammps", "budget"): "rolling sds",
    (
        "lammps",
        "epsd",
    ): "with its own stiffness and damping; in the study epsd is between two grains",
    (
        "lammps",
        "epsd2",
    ): "with its own stiffness and damping; in the study epsd2 is between two grains",
    ("yade", "budget"): "includeMoment=True",
    ("edem", "budget"): "Standard Rolling Friction (Type A)",
}


@pytest.mark.parametrize("particle", [THREE, BALL], ids=["clump", "sphere"])
@pytest.mark.parametrize("program", export.PROGRAMS)
def test_each_law_is_written_as_the_program_has_it_or_refused(
    config, program, particle, tmp_path
):
    constants = {
        "gamma_gg": 0.05,
        "gamma_gp": 0.02,
        "k_gg": 1e4,
        "k_gp": 1e4,
        "plas_gg": 0.5,
        "plas_gp": 0.5,
    }
    # key, law, what the programs have for it, and the pair of laws of the job
    cases = [("contact_law", law, CONTACT, (law, "budget")) for law in CONTACT_LAWS]
    cases += [
        ("rolling_law", law, ROLLING, ("hertz_mindlin", law)) for law in ROLLING_LAWS
    ]
    for key, law, written, pair in cases:
        job = job_of(config, particle, *pair, **constants)
        if (program, law) in written:
            deck = export.write_deck(job, program, tmp_path)[0]
            assert written[program, law] in deck.read_text()
            continue
        message = rf"simulation.{key} is '{law}'; expected .*hertz|budget"
        refusal = input_error(message, export.write_deck, job, program, tmp_path)
        is_lammps_jkr = (program, law) == ("lammps", "jkr")
        assert ("refuses cohesion" in str(refusal)) == is_lammps_jkr


# Words about the particle, whether the study's berry is a sphere, and what the deck holds.
ASKED = {
    "clump": (["--spheres", "5"], False, True),
    "sphere": ([], True, False),
    "one sphere": (["--spheres", "1"], True, False),
    "clump of a spherical berry": (["--spheres", "2"], True, True),
}


@pytest.mark.parametrize(
    ("arguments", "spherical", "is_clump"), ASKED.values(), ids=ASKED
)
def test_the_verb_writes_a_deck_of_clumps_or_spheres(
    monkeypatch, tmp_path, command, arguments, spherical, is_clump
):
    settings = {}

    def berry_and_particle(study):
        settings.update(study.config["berry"])
        axes = np.full((1, 3), 5 * MM) if spherical else SMOOTH.semi_axes_m
        return BERRY, THREE if settings["particle"] == "multisphere" else replace(
            SMOOTH, semi_axes_m=axes
        )

    monkeypatch.setattr(
        "repose.cli.berries.load_grain_and_particle", berry_and_particle
    )
    for program, name in (("liggghts", "in.pour"), ("yade", "pour.py")):
        made = [
            "export",
            "--to",
            program,
            "--config",
            CONFIG,
            "--set",
            "mus_gg=0.41",
            *arguments,
            "--out",
            tmp_path,
        ]
        assert command(*made).out.split()[0] == str(tmp_path / name)
        assert "mu_s 0.41" in (tmp_path / name).read_text()
    assert (
        "particletemplate/sphere" in (tmp_path / "in.pour").read_text()
    ) is not is_clump
    assert (tmp_path / "clump.txt").exists() is is_clump
    assert (settings["particle"] == "multisphere") is is_clump
    assert not is_clump or settings["spheres"] == int(arguments[1])


def test_a_card_brings_the_configuration_beside_it(monkeypatch, tmp_path, command):
    # The card of an earlier version, which has no settings to compare, only values.
    shown = json.loads((ROOT / "tests/known/card_of_version_0_3.json").read_text())
    config = PipelineConfig.load(CONFIG).config
    (tmp_path / "config.json").write_text(json.dumps(config))
    wall = {key: config["wall"][key] for key in card_study.WALL_KEYS}
    shown |= {
        "material": config["label"],
        "wall": wall,
        "laws": card_study.describe_laws(
            PipelineConfig.load(CONFIG).settings.simulation
        ),
    }
    shown["tests"][0]["bench"] = config["funnel"]
    (tmp_path / "card.json").write_text(json.dumps(shown))
    axes = dict(
        zip(
            ("long_mm", "major_mm", "minor_mm"),
            shown["grain"]["mean_axes_mm"],
            strict=True,
        )
    )
    berry = axes | {key: shown["grain"][key] for key in card_study.GRAIN_KEYS}
    monkeypatch.setattr(
        "repose.cli.berries.load_grain_and_particle", lambda *_: (berry, THREE)
    )
    arguments = [
        "export",
        "--to",
        "edem",
        "--card",
        tmp_path / "card.json",
        "--out",
        tmp_path / "deck",
    ]
    command(*arguments)
    value = shown["parameters"]["mus_gg"]["value"]
    assert f"{value:.6g}" in (tmp_path / "deck" / "edem.md").read_text()
    shown["simulation"] = {"time_step_s": 1e-6, "gravity_m_s2": 1.62}
    (tmp_path / "card.json").write_text(json.dumps(shown))
    assert (
        "simulation.gravity_m_s2 is 1.62; expected 9.81"
        in command(*arguments, status=2).err
    )
    shown["simulation"]["gravity_m_s2"] = 9.81
    (tmp_path / "card.json").write_text(json.dumps(shown))
    density = berry["density_kg_m3"]
    berry["density_kg_m3"] = 841.0
    assert (
        f"grain.density_kg_m3 is {density}; expected 841.0"
        in command(*arguments, status=2).err
    )


def test_a_card_with_a_record_of_its_settings_goes_with_its_own_study_alone(
    tmp_path, command
):
    """Also where nothing differs that the card itself says."""
    config = PipelineConfig.load(CONFIG).config
    shown = json.loads((ROOT / "crops/cards/wheat.json").read_text())
    record = {"verb": "material_card", "origin": "", "seed": 1, "engine": None}
    record["settings"] = dependencies.select_stage_settings(config, "material_card")
    card = tmp_path / "card.json"
    card.write_text(json.dumps(shown | {"provenance": record}))
    changed = config | {"miga": config["miga"] | {"islands": 7}}
    (tmp_path / "mine.json").write_text(json.dumps(changed))
    other = ["--configfile", tmp_path / "mine.json", "--out", tmp_path / "deck"]
    done = command("export", "--to", "edem", "--card", card, *other, status=2)
    assert (
        f"{card}: miga.islands is {config['miga']['islands']}; expected 7" in done.err
    )


@pytest.mark.parametrize("spheres", [1, 6])
def test_a_card_alone_is_enough_in_any_folder(tmp_path, monkeypatch, command, spheres):
    """Its own laws, wall, grain and bench test; the time step is at most that of the study where the card has it."""
    monkeypatch.chdir(tmp_path)
    shown = json.loads((ROOT / "crops/cards/wheat.json").read_text())
    arguments = [
        "export",
        "--to",
        "liggghts",
        "--card",
        "card.json",
        "--spheres",
        str(spheres),
    ]
    steps = {}
    for step in (None, 1e-6):
        shown |= (
            {}
            if step is None
            else {"simulation": {"time_step_s": step, "gravity_m_s2": 9.0}}
        )
        Path("card.json").write_text(json.dumps(shown))
        assert "built-in goji" not in command(*arguments, "--out", f"deck {step}").err
        text = Path(f"deck {step}/in.pour").read_text()
        steps[step] = float(re.search(r"timestep +(\S+)", text)[1])
        assert f"nparticles {shown['tests'][0]['bench']['berries']} " in text
        says(
            text,
            f"mu_s {shown['parameters']['mus_gg']['value']:.6g}",
            f"gravity {9.0 if step else 9.81:g} ",
        )
        assert "limitForce on" in text
        if spheres > 1:
            assert float(re.search(r" type 1 mass (\S+)", text)[1]) == pytest.approx(
                1e-3 * shown["grain"]["mass_g"]
            )
            moments = [
                float(word)
                for word in re.search(
                    r"inertia_tensor (\S+) 0 0 (\S+) 0 (\S+)", text
                ).groups()
            ]
            a, b, c = 0.5e-3 * np.array(shown["grain"]["mean_axes_mm"])
            solid = (
                1e-3
                * shown["grain"]["mass_g"]
                / 5
                * np.array([b**2 + c**2, a**2 + c**2, a**2 + b**2])
            )
            assert moments == pytest.approx(solid, rel=0.01)
    assert steps[1e-6] == pytest.approx(0.5e-6)
    # whose files lie elsewhere
    goji = [
        *arguments[:4],
        ROOT / "results/published/goji_berry/card.json",
        *arguments[5:],
    ]
    assert (
        "berry.compression is 'resources/compression.csv'"
        in command(*goji, "--out", "goji").err
    )
    assert Path("goji/in.pour").exists()
    assert steps[None] > 5 * steps[1e-6]
    law = "card.json: laws is 'another law'; expected laws of this version"
    drum = (
        shown["tests"][0],
        "apparatus",
        "drum",
        "expected the card of a study with piles of the funnel",
    )
    for entry, key, value, message in (
        (shown["laws"], "normal", "another law", law),
        drum,
    ):
        entry[key] = value
        Path("card.json").write_text(json.dumps(shown))
        assert message in command(*arguments, "--out", "deck", status=2).err
