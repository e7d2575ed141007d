"""Sizes that one grain cannot stand for: its mass, and what `repose check` says of them."""

from types import SimpleNamespace

import numpy as np
import pytest
from refusals import input_error
from shared import ROOT

from repose.config import check
from repose.config.pipeline import PipelineConfig
from repose.grain import size_distribution
from repose.grain.berry_files import SIZE_COLUMNS, read_sizes

# Pellets of 1.2 and 3 mm, half of each
TWO_GROUPS = ROOT / "tests/config/two_groups.csv"
PELLETS = """
label: pellet
berry: {sizes: sizes.csv, density_kg_m3: 1580, poisson_ratio: 0.3, shear_modulus_pa: 1.0e+7}
wall: {poisson_ratio: 0.3, shear_modulus_pa: 1.0e+9}
parameters:
  mus_gg: [0.2, 0.9]
  mur_gg: [0.005, 0.1]
  e_gg: {fixed: 0.5}
  mus_gp: {fixed: 0.8}
  mur_gp: {fixed: 0.3}
  e_gp: {fixed: 0.5}
funnel:
  berries: 300
  rate_per_s: 100
  inlet_diameter_mm: 60
  outlet_diameter_mm: 15
  cone_angle_deg: 60
  outlet_height_mm: 30
  plate_diameter_mm: 200
measure: {response: whole}
targets: [{response: aor_deg, value: 30, sd: 1, repetitions: 10}]
surrogate: gaussian_process
"""


@pytest.fixture
def study(tmp_path, monkeypatch):
    """Make the study of a table of sizes (N, 3), with changes of its section `berry`."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "config.yaml").write_text(PELLETS)

    def load(sizes, **grain):
        rows = [",".join(map(str, row)) for row in np.asarray(sizes).tolist()]
        text = "\n".join([",".join(SIZE_COLUMNS), *rows])
        (tmp_path / "sizes.csv").write_text(text + "\n")
        return PipelineConfig.load("config.yaml", overrides={"berry": grain})

    return load


def warnings(study):
    return [line for line in check._describe_sizes(study) if "WARNING" in line]


def spheres(spread, count=400):
    """Diameters of normal quantiles around 3 mm: the same for every run of the tests."""
    rng = np.random.default_rng(7)
    z = rng.normal(size=count)
    z = (z - z.mean()) / z.std(ddof=1)
    return np.repeat((3 * (1 + spread * z))[:, None], 3, axis=1).round(6)


def test_pellets_of_two_sizes_have_their_mean_mass(study):
    sizes = read_sizes(TWO_GROUPS)
    made = study(sizes)
    masses = 1580e-9 * np.pi / 6 * sizes.prod(axis=1)
    assert masses.mean() == pytest.approx(11.914e-6, rel=1e-4)
    # As with a scan, the volume of the body differs from the mesh's by little.
    assert made.particle.mass_kg == pytest.approx(masses.mean(), rel=1e-6)
    groups, spread = warnings(made)
    assert "50 % of the grains have about 1.21 mm" in groups
    assert "50 % of the grains have about 3 mm" in groups
    assert "scatters by 43 %" in spread
    assert "less volume" not in spread


def test_mean_axes_lose_the_share_that_the_message_states(study):
    made = study(read_sizes(TWO_GROUPS), mean_size="axes")
    assert made.grain["long_mm"] == pytest.approx(2.1042)
    assert made.particle.mass_kg == pytest.approx(7.7076e-6, rel=1e-4)
    assert "35 % less volume" in warnings(made)[1]  # 1 - 7.7076 / 11.914


def test_a_spread_of_19_percent_loses_nothing(study):
    sizes = spheres(0.19)
    made = study(sizes)
    mean_mass = 1580e-9 * np.pi / 6 * np.mean(sizes[:, 0] ** 3)
    assert made.particle.mass_kg == pytest.approx(mean_mass, rel=1e-6)
    # E[d^3] = m^3 (1 + 3 s^2), without the third moment of this sample
    mean_axes = 1580e-9 * np.pi / 6 * np.mean(sizes[:, 0]) ** 3
    assert mean_mass / mean_axes == pytest.approx(1 + 3 * 0.19**2, abs=0.005)
    (spread,) = warnings(made)
    assert "scatters by 19 %" in spread


def test_drawn_sizes_have_the_mean_mass_of_the_measured_ones(study):
    sizes = spheres(0.19)
    made = study(sizes, size_distribution="measured")
    scales, _ = size_distribution.draw_scales("measured", made.grain, 1, 100_000)
    volumes = scales**3
    error = volumes.std() / np.sqrt(len(volumes))
    drawn = made.particle.mass_kg * volumes.mean()
    mean_mass = 1580e-9 * np.pi / 6 * np.mean(sizes[:, 0] ** 3)
    assert drawn == pytest.approx(mean_mass, rel=4 * error)
    # The diameters themselves return, too.
    diameters = made.grain["long_mm"] * scales
    assert diameters.mean() == pytest.approx(sizes[:, 0].mean(), rel=0.005)
    assert diameters.std() == pytest.approx(sizes[:, 0].std(), rel=0.03)


def test_alike_grains_are_not_mentioned_and_keep_their_axes(study):
    made = study(spheres(0.05))
    assert warnings(made) == []
    # One of four differs by 0.4 % from three alike ones: no group that matters
    sizes = [[2.58, 1.32, 1], [2.56, 1.32, 1.02], [2.62, 1.3, 1], [2.58, 1.32, 1]]
    assert warnings(study(sizes)) == []
    equal = study([[6.75, 3.26, 2.77]] * 2)
    axes = [equal.grain[name] for name in SIZE_COLUMNS]
    assert axes == [6.75, 3.26, 2.77]


def test_a_mass_makes_no_grain_fuller_than_a_sphere(study):
    sphere_g = 1580e-6 * np.pi / 6 * 27
    equal = [[3, 3, 3]] * 3
    assert warnings(study(equal, mass_g=sphere_g)) == []
    (fuller,) = warnings(study(equal, mass_g=1.1 * sphere_g))
    assert "10 % fuller than its mean axes allow" in fuller
    assert warnings(study(equal, mass_g=1.01 * sphere_g)) == []
    # The right mass of spheres that scatter makes the sphere of their mean too full.
    sizes = spheres(0.19)
    mean_g = 1580e-6 * np.pi / 6 * np.mean(sizes[:, 0] ** 3)
    spread, fuller = warnings(study(sizes, mass_g=mean_g))
    ratio = np.mean(sizes[:, 0] ** 3) / np.mean(sizes[:, 0]) ** 3
    assert f"{100 * (1 - 1 / ratio):.2g} % less volume" in spread
    assert f"{100 * (ratio - 1):.2g} % fuller" in fuller


def test_a_mass_that_no_body_of_the_mean_axes_has_names_the_way_out(study):
    # The true mean mass of pellets of 1.2 and 3 mm
    fault = input_error(
        "mass_g is 0.011914", study, read_sizes(TWO_GROUPS), mass_g=0.011914
    )
    assert "without it, the mean volume of the sizes is taken" in fault.allowed


def test_a_long_grain_may_be_fuller_than_an_ellipsoid(study):
    # 20 % more than an ellipsoid, as a goji berry
    mass_g = 1.2 * 1580e-6 * np.pi / 6 * 21 * 11 * 10
    assert warnings(study([[21, 11, 10]] * 2, mass_g=mass_g)) == []


def test_the_articles_grain_keeps_the_mean_axes_of_table_1():
    goji = PipelineConfig.load(ROOT / "config/config.yaml")
    paper = PipelineConfig.load(ROOT / "config/config.yaml", ROOT / "config/paper.yaml")
    for made in (goji, paper):
        axes = [made.grain[name] for name in SIZE_COLUMNS]
        assert axes == [21.14, 11.37, 9.88]
        assert warnings(made) == []
    assert paper.settings.berry.mean_size == "axes"
    overrides = {"berry": {"mean_size": "volume"}}
    scaled = PipelineConfig.load(
        ROOT / "config/config.yaml", ROOT / "config/paper.yaml", overrides=overrides
    )
    sizes = read_sizes(ROOT / "resources/berries.csv")
    volume = np.pi / 6 * sizes.prod(axis=1).mean()
    assert 1e9 * scaled.particle.volume_m3 == pytest.approx(volume, rel=1e-6)
    assert volume / (1e9 * paper.particle.volume_m3) == pytest.approx(1.0259, abs=1e-4)


def grain_warnings(section, **particle):
    """Warnings of a section `berry` whose particle has these numbers."""
    study = SimpleNamespace(
        settings=SimpleNamespace(berry=section),
        particle=SimpleNamespace(
            **{"mass_kg": 1e-3, "volume_m3": 1.0, "mesh_volume_m3": 1.0} | particle
        ),
    )
    return list(check._describe_grain(study))


def test_what_has_no_effect_on_the_grain_is_named(study):
    plain = study(spheres(0.01)).settings.berry
    assert grain_warnings(plain) == []
    # Each alone has an effect.
    for alone in ({"stl": "a.stl"}, {"mass_g": 2.0}):
        assert grain_warnings(plain.model_copy(update=alone)) == []
    scan = plain.model_copy(update={"stl": "a.stl", "mass_g": 2.0})
    assert grain_warnings(scan) == [
        "mass: WARNING: the mass of berry.stl is used, 1 g; berry.mass_g is not used"
    ]
    tested = plain.model_copy(update={"compression": "tests.csv"})
    assert grain_warnings(tested) == [
        "moduli: WARNING: berry.shear_modulus_pa and berry.poisson_ratio are used; "
        "berry.compression is not used"
    ]
    for missing in ("shear_modulus_pa", "poisson_ratio"):
        assert grain_warnings(tested.model_copy(update={missing: None})) == []


def test_a_wide_spread_names_what_is_poured_and_the_volume_that_is_lost(study):
    plain = study(spheres(0.01)).settings.berry
    spread = "sizes: WARNING: the equivalent diameter scatters by 30 %"
    alike = "; all poured grains have the same size; set berry.size_distribution to measured to pour different sizes"
    loss = "12 % less volume than the measured grains have on average"
    fuller = f"; a grain with the mean axes has {loss}, and berry.mass_g makes its body fuller to compensate"
    cases = [
        ({}, alike),
        (
            {"size_distribution": "measured"},
            ", and is drawn from a normal distribution",
        ),
        ({"mass_g": 2.0}, alike + fuller),
        ({"mass_g": 2.0, "stl": "a.stl"}, alike),
        (
            {"mean_size": "axes"},
            f"{alike}; with berry.mean_size: axes the grain has {loss}",
        ),
    ]
    for update, expected in cases:
        section = plain.model_copy(update=update)
        said = check._describe_spread(section, relative_sd=0.3, lost_fraction=0.12)
        assert said == spread + expected


def test_two_groups_of_sizes_are_described_with_what_is_poured():
    groups = SimpleNamespace(counts=(30, 10), diameters_mm=(1.2, 3.0))
    for distribution, poured in (
        ("mean", "equal grains of the mean volume are poured"),
        ("measured", "sizes of one normal distribution are poured"),
    ):
        assert check._describe_groups(groups, distribution) == (
            "sizes: WARNING: the grains form two groups: 75 % of the grains have about "
            f"1.2 mm, 25 % of the grains have about 3 mm; {poured}; calibrate each group "
            "separately"
        )
