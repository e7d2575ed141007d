"""The grain from its measurements, from a few numbers, and the distribution of its sizes."""

import json
import math

import numpy as np
import pandas as pd
import pytest
from refusals import input_error
from scipy.stats import shapiro, truncnorm
from shared import ROOT, written

from repose.cli import main
from repose.grain import berry, berry_files, build, mesh_from_axes, size_distribution
from repose.grain.mesh import move_to_principal_pose
from repose.grain.settings import GrainSettings

RESOURCES = ROOT / "resources"
SIZES = RESOURCES / "berries.csv"
COMPRESSION = RESOURCES / "compression.csv"
TABLE1 = RESOURCES / "published" / "table1.csv"
GOJI = (15.40, 10.41, 13.32)  # equivalent diameter of Table 1: maximum, minimum, mean


def run(out_dir, **changes):
    section = {
        "sizes": SIZES,
        "compression": COMPRESSION,
        "density_kg_m3": 840.47,
        "poisson_ratio": None,
        "shear_modulus_pa": None,
        "stl": None,
        "mass_g": None,
        "mean_size": "axes",
    }
    section = GrainSettings.model_construct(**section | changes)
    berry.run(section, TABLE1, out_dir)
    return berry.compute_configured_grain(section, TABLE1)


def test_equations_by_hand():
    # 8 * 4 * 2 = 64, its cube root 4, half of the long axis.
    assert berry.equivalent_diameter(8.0, 4.0, 2.0) == pytest.approx(4.0)
    assert berry.sphericity(8.0, 4.0, 2.0) == pytest.approx(0.5)
    assert berry.sphericity(7.0, 7.0, 7.0) == pytest.approx(1.0)
    # Section pi/4 * 20 mm * 10 mm = 157.08 mm2, strain 10 %: 2 N make 12732 Pa of stress.
    assert berry.elastic_modulus(2.0, 0.020, 0.010, 0.008, 0.0072) == pytest.approx(
        2 / (np.pi * 50e-6) / 0.1
    )
    assert berry.poisson_ratio(20.0, 20.6, 8.0, 7.2) == pytest.approx(0.3)
    assert berry.shear_modulus(1.1352e5, 0.32) == pytest.approx(4.3e4)


def test_shipped_measurements_are_those_of_the_article():
    sizes = berry.read_sizes(SIZES)
    assert len(sizes) == 50
    assert sizes.attrs["reconstruction"]
    summary = berry.summarise_sizes(sizes, pd.read_csv(TABLE1))
    for statistic in ("maximum", "minimum", "mean"):
        # Axes: on the grid of 0.01 mm the three are exact, not only rounded.
        assert np.abs(summary[f"difference_{statistic}"][:3]).max() < 1e-9
        assert np.abs(summary[f"difference_{statistic}"]).max() < 0.005
    assert (berry.sphericity(*(sizes[c] for c in berry.SIZE_COLUMNS)) < 0.8).all()
    assert (sizes * 100).round().div(100).equals(sizes)
    for column in berry.SIZE_COLUMNS:
        assert shapiro(sizes[column]).pvalue > 0.2
    elastic, poisson, shear = berry.compute_moduli(berry.read_compression(COMPRESSION))
    assert f"{elastic:.4e}" == "1.1352e+05"
    assert f"{poisson:.2f}" == "0.32"
    assert f"{shear:.1e}" == "4.3e+04"


def test_run_writes_both_files(tmp_path):
    summary, record = run(tmp_path)
    on_disk = pd.read_csv(tmp_path / "summary.csv")
    pd.testing.assert_frame_equal(
        on_disk, summary, check_exact=False, atol=6e-5, rtol=0
    )
    assert json.loads((tmp_path / "berry.json").read_text()) == record
    assert record["long_mm"] == 21.14
    assert record["major_mm"] == 11.37
    assert record["minor_mm"] == 9.88
    assert record["n"] == 50
    assert record["reconstruction"] is True


def test_given_moduli_replace_the_measured_ones(tmp_path):
    _, record = run(
        tmp_path, compression=None, poisson_ratio=0.25, shear_modulus_pa=2e4
    )
    assert record["poisson_ratio"] == 0.25
    assert record["shear_modulus_pa"] == 2e4
    assert record["elastic_modulus_pa"] == pytest.approx(5e4)
    _, record = run(tmp_path, shear_modulus_pa=2e4)
    assert record["poisson_ratio"] == pytest.approx(0.32, abs=0.005)
    assert record["shear_modulus_pa"] == 2e4
    input_error("compression", run, tmp_path, compression=None, poisson_ratio=0.25)


def test_measured_sizes_are_not_marked_as_a_reconstruction(tmp_path):
    text = "# caliper, 1 May\nberry, minor_mm,long_mm,major_mm\n1,9,20,10\n\n2,8,22,11\n"  # columns in any order
    quoted = written(
        tmp_path / "sizes.csv",
        '"# mine"\n"", "long_mm","major_mm","minor_mm"\n"1",20,10,9\n"2",22,11,8\n',
    )
    assert berry.read_sizes(quoted)["long_mm"].tolist() == [20.0, 22.0]
    path = written(tmp_path / "sizes.csv", text)
    assert berry.read_sizes(path).loc[2].to_dict() == {
        "long_mm": 22.0,
        "major_mm": 11.0,
        "minor_mm": 8.0,
    }
    _, record = run(
        tmp_path, sizes=path, compression=None, poisson_ratio=0.3, shear_modulus_pa=1e4
    )
    assert record["reconstruction"] is False
    assert record["n"] == 2
    assert record["long_mm"] == 21.0


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("long_mm,major_mm\n20,10\n21,10\n", ["column minor_mm", "missing"]),
        (
            "# x\nlong_mm,major_mm,minor_mm\n20,10,9\n10,21,9\n",
            ["row 2", "major_mm", "21", "long_mm"],
        ),
        (
            "long_mm,major_mm,minor_mm\n20,10,9\n21,10,12\n",
            ["row 2", "minor_mm", "12", "major_mm"],
        ),
        ("long_mm,major_mm,minor_mm\n20,10,9\n", ["rows", "at least 2"]),
        ("long_mm;major_mm;minor_mm\n20,1;10;9\n", ["rows is 1", "at least 2"]),
        (
            "long_mm,major_mm,minor_mm\n20,10,9\n21,1_0,9\n",
            ["row 2", "major_mm", "1_0"],
        ),
        ('long_mm,major_mm,minor_mm\n20,10,"9\n21,10,9\n', ["cells is", "CSV"]),
    ],
)
def test_bad_sizes_are_named(tmp_path, text, parts):
    path = written(tmp_path / "sizes.csv", text)
    message = str(input_error("expected", berry.read_sizes, path))
    assert [part for part in (str(path), *parts) if part not in message] == []


def test_a_load_that_does_not_shorten_is_refused(tmp_path):
    header = ",".join(berry_files.COMPRESSION_COLUMNS)
    path = written(tmp_path / "sizes.csv", f"{header}\n1,2.0,20,20.5,9,9.1,11\n")
    input_error(r"row 1: width_2_mm is 9\.1", berry.read_compression, path)


def test_impossible_material_is_refused_and_published_tables_hold_together(tmp_path):
    wrong = (
        ("density_kg_m3", 0.0),
        ("poisson_ratio", 0.6),
        ("shear_modulus_pa", -1.0),
        ("density_kg_m3", np.nan),
    )
    for key, value in wrong:
        input_error(key, run, tmp_path, **{key: value})
    published = RESOURCES / "published"
    ranges = pd.read_csv(published / "table2.csv").set_index("parameter")
    intervals = pd.read_csv(published / "table3.csv").set_index("parameter")
    width = (
        (intervals["high"] - intervals["low"]) / (ranges["high"] - ranges["low"]) * 100
    )
    # mus_gp and e_gp included: dispersion is the interval's width over the range's.
    assert np.abs(width[intervals.index] - intervals["dispersion_percent"]).max() < 0.01
    solutions = pd.read_csv(published / "table4.csv").set_index("solution")
    for response in ("aor", "height"):
        unit = "deg" if response == "aor" else "mm"
        simulated = solutions[f"{response}_simulated_{unit}"]
        error = (solutions[f"{response}_predicted_{unit}"] / simulated - 1).abs() * 100
        assert np.nanmax(np.abs(error - solutions[f"{response}_error_percent"])) < 0.011
    assert solutions.loc["representative", "mus_gg"] == 0.642


def test_the_spread_of_a_published_range():
    sd, low, high = size_distribution.estimate_spread(*GOJI)
    assert sd == pytest.approx(4.99 / 4.498 / 13.32)
    assert low == pytest.approx(10.41 / 13.32)
    assert high == pytest.approx(15.40 / 13.32)
    # What 4.498 stands for: the mean range of 50 normal values.
    ranges = np.ptp(np.random.default_rng(1).normal(size=(20000, 50)), axis=1)
    expected = size_distribution.PUBLISHED_RANGE_SD
    assert ranges.mean() == pytest.approx(expected, abs=0.02)


def test_the_spread_of_measured_sizes():
    assert size_distribution.compute_spread([9.0, 10.0, 11.0]) == pytest.approx(
        (0.1, 0.9, 1.1)
    )


def test_drawn_scales_have_the_moments_of_a_truncated_normal():
    spread = size_distribution.estimate_spread(*GOJI)
    drawn = size_distribution.draw_sizes(np.random.default_rng(2), 200_000, *spread)
    assert np.mean(drawn**3) == pytest.approx(1.0, abs=2e-3)
    sd, low, high = spread
    theirs = truncnorm((low - 1) / sd, (high - 1) / sd, 1, sd)
    norm = np.cbrt(theirs.moment(3))
    assert size_distribution.compute_normalisation(*spread) == pytest.approx(
        norm, rel=1e-9
    )
    assert drawn.std() == pytest.approx(theirs.std() / norm, rel=0.01)
    assert drawn.min() >= low / norm
    assert drawn.max() <= high / norm


def test_a_pour_draws_from_its_seed_up_to_the_largest_scale():
    berry = dict(
        zip(
            size_distribution.SPREAD_KEYS,
            size_distribution.estimate_spread(*GOJI),
            strict=True,
        )
    )
    first, largest = size_distribution.draw_scales("measured", berry, 7, 500)
    again, _ = size_distribution.draw_scales("measured", berry, 7, 500)
    other, _ = size_distribution.draw_scales("measured", berry, 8, 500)
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - other).max() > 0.05
    assert first.max() <= largest
    equal, scale = size_distribution.draw_scales("none", {}, 7, 3)
    assert equal.tolist() == [1, 1, 1]
    assert scale == 1
    input_error("scale_sd", size_distribution.draw_scales, "measured", {}, 7, 3)
    berry = {"scale_sd": 0.4, "scale_low": 0.3, "scale_high": 1.2}
    scales, most = size_distribution.draw_scales("measured", berry, 1, 20_000)
    assert most - 1e-3 < scales.max() <= most


GOJI_MM = (21.14, 11.37, 9.88)
GOJI_G = 1.25
DENSITY = 840.47


def fullness(shape):
    """Share of its bounding box that a smooth body fills, V / (L W T), in closed form."""
    m, k = mesh_from_axes.compute_profile_exponents(shape)
    beta = math.gamma(1 / m) * math.gamma(2 * k + 1) / math.gamma(1 / m + 2 * k + 1)
    return math.pi / 4 * beta / m


def test_fullness_in_closed_form():
    found = [fullness(number) for number in (1.0, 2.0, 3.0, 1e3)]
    expected = [np.pi / 4 * 8 / 15, np.pi / 6, 0.63308, np.pi / 4]
    assert found == pytest.approx(expected, rel=2e-4)


@pytest.mark.parametrize("number", [1.2, 2.0, 2.9, 5.0])
def test_the_mesh_has_the_axes_the_mass_and_the_exponent_it_was_made_from(number):
    axes = np.array([20.0, 12.0, 9.0])
    mass = 1e-6 * DENSITY * fullness(number) * axes.prod()
    mesh, found = mesh_from_axes.make_grain_mesh(axes, mass, DENSITY)
    assert mesh.is_watertight
    assert mesh.volume * DENSITY * 1e-6 == pytest.approx(mass, rel=1e-9)
    np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), axes, rtol=1e-3)
    assert found == pytest.approx(number, rel=0.02)


def test_a_grain_of_axes_and_mass_is_written_and_said(tmp_path, capsys):
    arguments = [
        "--axes",
        "20",
        "12",
        "9",
        "--mass-g",
        "1.2",
        "--density",
        "1000",
        f"--stl={tmp_path / 'a.stl'}",
    ]
    main(["stage", "berry", *arguments])
    assert f"1200 mm3, {1200 / 20 / 12 / 9:.3f} of the box" in capsys.readouterr().out


def test_taper_and_wrinkles_keep_mass_and_axes():
    mesh, _ = mesh_from_axes.make_grain_mesh(
        GOJI_MM, 1.05, DENSITY, taper=0.1, wrinkles=8, wrinkle_depth_mm=0.2
    )
    assert mesh.is_watertight
    assert mesh.volume * DENSITY * 1e-6 == pytest.approx(1.05, rel=1e-9)
    np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), GOJI_MM, rtol=2e-3)
    assert mesh.center_mass[0] > 0.1
    # Grooves: the belly's radius swings by their depth, eight times round.
    ring = mesh.vertices[
        np.abs(mesh.vertices[:, 0] - 1.0).argsort()[: mesh_from_axes.SECTORS]
    ]
    size = np.hypot(ring[:, 1] / GOJI_MM[1], ring[:, 2] / GOJI_MM[2]) * 2
    assert np.ptp(size) == pytest.approx(0.2 / (GOJI_MM[2] / 2), rel=0.05)


@pytest.mark.parametrize("taper", [-0.5, 0.5])
def test_the_largest_taper_is_allowed(taper):
    mesh, _ = mesh_from_axes.make_grain_mesh(GOJI_MM, 0.78, DENSITY, taper=taper)
    # The thick end, and with it the centre of mass, is on the side of its sign.
    assert np.sign(mesh.center_mass[0]) == np.sign(taper)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"mass_g": 2.0}, "to 1.56 for these axes"),
        ({"mass_g": 0.5}, "0.42 to 0.78 of the box"),
        ({"axes_mm": (9.0, 12.0, 20.0)}, "longest first"),
        ({"axes_mm": (20.0, 9.0, 12.0)}, "longest first"),
        ({"axes_mm": (20.0, 12.0, 0.0)}, "longest first"),
        ({"axes_mm": (20.0, 12.0)}, "longest first"),
        ({"axes_mm": (np.inf, 12.0, 9.0)}, "longest first"),
        ({"taper": 2.0}, "-0.5 to 0.5"),
        ({"wrinkles": 5}, "wrinkle_depth_mm"),
        ({"wrinkle_depth_mm": 0.2}, "together with wrinkle_depth_mm"),
        ({"wrinkles": 2, "wrinkle_depth_mm": 0.2}, "3 to 40"),
        ({"wrinkles": 41, "wrinkle_depth_mm": 0.2}, "3 to 40"),
        ({"wrinkles": 5, "wrinkle_depth_mm": 3.0}, "0 to 0.741"),
        ({"density_kg_m3": -1.0}, "positive"),
    ],
)
def test_impossible_berries_are_refused_with_what_is_allowed(keys, message):
    arguments = {"axes_mm": GOJI_MM, "mass_g": GOJI_G, "density_kg_m3": DENSITY} | keys
    input_error(message, mesh_from_axes.make_grain_mesh, **arguments)


def test_poissons_ratio_of_the_tests_is_from_0_to_a_half():
    for possible in (0.0, 0.5):
        berry._check_poisson_ratio("tests.csv", possible)
    for impossible in (-0.01, 0.51, np.nan):
        message = f"^tests.csv: poisson_ratio is {impossible}; expected from 0 to 0.5$"
        input_error(message, berry._check_poisson_ratio, "tests.csv", impossible)


def test_the_goji_berry_is_two_ellipsoids():
    """1.25 g and 1487 mm3, as measured, within 1 % of the minor axis by two components."""
    particle = build.fit_particle(
        move_to_principal_pose(
            mesh_from_axes.make_grain_mesh(GOJI_MM, GOJI_G, DENSITY)[0]
        ),
        DENSITY,
    )
    assert particle.kind == "smooth"
    assert len(particle.semi_axes_m) == 2
    assert particle.volume_m3 * 1e9 == pytest.approx(1487.3, rel=2e-3)
    assert particle.mass_kg == pytest.approx(1.25e-3, rel=2e-3)
    assert particle.deviation_max_m < 0.01 * 9.88e-3
    np.testing.assert_allclose(particle.axes_m * 1e3, GOJI_MM, rtol=0.012)
    expected = particle.mesh_inertia_kg_m2
    np.testing.assert_allclose(particle.inertia_kg_m2, expected, rtol=0.005)
