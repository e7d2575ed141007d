"""The example of the lifted piles: its measures beside known shapes and a slow twin, and a small pile."""

import importlib.util
import json
import re
import statistics
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from shared import ROOT

sys.path.insert(0, str(Path(__file__).parents[2] / "examples" / "lifted_piles"))
import compare
import discharges
import drums
import lifted_piles
import more_places
from lifted_piles import Contents, Grains

from repose.dem.rotations import rotation_matrix

spec = importlib.util.spec_from_file_location(
    "campaign_of_piles", Path(drums.__file__).with_name("campaign.py")
)
# tests/faults has a module `campaign`, too
campaign = importlib.util.module_from_spec(spec)
spec.loader.exec_module(campaign)
RADIUS_M = 0.00185


def grains(centres_m, radii_m=RADIUS_M):
    radii = np.broadcast_to(radii_m, len(centres_m)).copy()
    return Grains(np.asarray(centres_m, float), radii, np.zeros(len(centres_m)))


def cone(degrees, count=6000, height_m=0.04):
    """Grains anywhere in a cone of an angle, none of them above its surface; its axis is not the origin."""
    rng = np.random.default_rng(3)
    slope = np.tan(np.radians(degrees))
    x, y = rng.uniform(-height_m / slope, height_m / slope, (2, 40 * count))
    tops = rng.uniform(0.0, height_m, x.size)
    inside = tops < height_m - slope * np.hypot(x, y)
    return grains(
        np.column_stack([x + 0.01, y - 0.02, tops - RADIUS_M])[inside][:count]
    )


@pytest.mark.parametrize("degrees", [15.0, 25.0, 35.0])
def test_the_angle_of_a_cone_is_found(degrees):
    found = lifted_piles.angle(cone(degrees))
    assert found["angle_deg"] == pytest.approx(degrees, abs=0.6)
    assert not found["flat"]
    assert found["height_mm"] == pytest.approx(40.0, abs=4.0)


def test_a_low_pile_is_measured_without_the_grains_that_fly():
    low = cone(8.0, height_m=0.012)
    found = lifted_piles.angle(low)
    assert found["flat"]
    assert found["angle_deg"] == pytest.approx(8.0, abs=1.0)
    above = np.column_stack([low.centres_m[:50, :2], np.full(50, 0.05)])
    flying = grains(above)._replace(speeds_m_s=np.ones(50))
    together = Grains(*map(np.concatenate, zip(low, flying, strict=True)))
    assert lifted_piles.angle(together) == {**found, "moving": 50}


def test_rings_are_those_of_a_slow_twin():
    """A ring's height is its highest top with three others in the 1.5 widths below it; without one, the median."""
    rng = np.random.default_rng(1)
    out = 0.05 * np.sqrt(rng.random(900))
    tops = 0.03 * rng.random(900)
    width = 2.0 * RADIUS_M
    expected = []
    for number in range(int(np.ceil(out.max() / width))):
        ring = [
            top
            for r, top in zip(out, tops, strict=True)
            if number * width <= r < (number + 1) * width
        ]
        resting = [
            top
            for top in ring
            if sum(top - 1.5 * width < other <= top for other in ring) >= 4
        ]
        if len(ring) >= 4:
            middle = (number + 0.5) * width
            expected.append((middle, max(resting, default=np.median(ring))))
    np.testing.assert_allclose(
        np.transpose(lifted_piles.rings(out, tops, width)), expected
    )


def test_the_density_of_a_bed_is_its_solid_share_of_that_of_the_grains():
    """Centres at random in 60 mm of the tube; the level is a radius above the highest of them."""
    rng = np.random.default_rng(2)
    share = 0.6
    volume = np.pi * lifted_piles.TUBE_RADIUS_M**2 * 0.06
    count = round(share * volume / (4.0 / 3.0 * np.pi * RADIUS_M**3))
    out = lifted_piles.TUBE_RADIUS_M * np.sqrt(rng.random(count))
    turn = 2.0 * np.pi * rng.random(count)
    height = rng.uniform(0.0, 0.06, count)
    bed = grains(np.column_stack([out * np.cos(turn), out * np.sin(turn), height]))
    found = lifted_piles.density(bed)
    expected = share * lifted_piles.DENSITY_KG_M3
    assert found["density_kg_m3"] == pytest.approx(expected, rel=0.03)
    assert found["level_mm"] == pytest.approx(60.0 + 1e3 * RADIUS_M, abs=1.0)


def test_grains_are_thrown_without_overlap_the_largest_first_with_the_shares_by_mass():
    sizes = lifted_piles.diameters_mm()
    masses = [np.sum(sizes[sizes == size] ** 3) for size in lifted_piles.DIAMETERS_MM]
    np.testing.assert_allclose(masses / np.sum(masses), [0.25, 0.5, 0.25], atol=2e-4)
    assert (np.diff(sizes) <= 0.0).all()
    radii = 5e-4 * lifted_piles.diameters_mm(200)
    centres = lifted_piles.places_m(radii, 1)
    gaps = np.linalg.norm(centres[:, None] - centres, axis=2) - radii - radii[:, None]
    assert gaps[~np.eye(len(radii), dtype=bool)].min() > 0.0
    assert (np.hypot(*centres[:, :2].T) + radii).max() < lifted_piles.FILLED_M[0]


@pytest.fixture(params=["budget", pytest.param("epsd2", marks=pytest.mark.slow)])
def rolling_law(request, monkeypatch):
    """The rolling law of the scenes: the example's needs kernels of its own, the other tests have those of budget."""
    monkeypatch.setitem(lifted_piles.LAWS, "rolling_law", request.param)


def test_the_laws_of_the_decks_make_each_scene():
    contents = Contents(0.4, 0.1, 0.5)
    assert lifted_piles.LAWS["rolling_law"] == "epsd2"
    assert lifted_piles.filled(contents, 1, 0.01, grains=20).n_bodies == 20
    assert discharges.closed(contents, 1, 0.1, grains=20).n_bodies == 20


@pytest.mark.usefixtures("rolling_law")
def test_a_small_pile_is_lifted_and_rests(monkeypatch):
    monkeypatch.setattr(lifted_piles, "LIFTING_M_S", 0.1)
    simulation = lifted_piles.filled(Contents(0.4, 0.1, 0.5), 1, 0.01, grains=200)
    assert simulation.n_bodies == 200
    settled, final, behind = lifted_piles.lifted(simulation)
    assert simulation.time_s == pytest.approx(0.4 + 0.55 + 0.4, abs=0.01)
    assert np.hypot(*settled.centres_m[:, :2].T).max() < 0.04
    assert behind < 20
    assert np.median(final.speeds_m_s) < 0.01
    assert final.centres_m[:, 2].min() > 0.9 * 0.0017
    assert abs(lifted_piles.angle(final)["angle_deg"]) < 20.0


def test_only_numbers_and_parameters_of_rows_were_taken():
    table = pd.read_csv(lifted_piles.HERE / "parameters.csv")
    assert list(table.columns) == ["test", "row", "fric", "rollfric", "rest"]
    assert table.groupby("test").size().to_dict() == {
        "pile": 45,
        "drum": 9,
        "discharge": 9,
        "tilted_drum": 3,
    }
    within = table[["fric", "rollfric", "rest"]]
    assert ((within >= [0.2, 0.0, 0.3]) & (within <= [0.6, 0.25, 0.7])).all(axis=None)


def test_the_campaign_takes_the_softest_modulus_that_changes_little(monkeypatch):
    assert campaign.five() == [13, 6, 16, 43, 28]

    def modulus_of(shift_deg, of_density):
        def means(row, modulus):
            softer = modulus < 1.0
            angle = 20.0 + (shift_deg[row == 43] * softer if modulus == 0.01 else 0.0)
            return pd.Series(
                {
                    "angle_deg": angle,
                    "density_kg_m3": 800.0 * (1.0 + of_density * (modulus == 0.01)),
                }
            )

        monkeypatch.setattr(campaign, "means", means)
        order = [*campaign.jobs(), *campaign.other_jobs()]
        assert order[:5] == [(row, 1, 0.01) for row in campaign.five()]
        assert len(set(order)) == len(order) - 10 == 30 + 2 + 80
        assert order[30:32] == [(1, 1, order[-1][2]), (4, 1, order[-1][2])]
        return order[-1][2]

    assert modulus_of((0.4, 0.9), 0.004) == 0.01
    assert (
        modulus_of((0.6, 0.6), 0.0)
        == modulus_of((0.0, 1.1), 0.0)
        == modulus_of((0.0, 0.0), 0.006)
        == 0.1
    )


@pytest.mark.parametrize("tilted", [False, True])
def test_the_angle_of_a_bed_in_the_drum_is_found(tilted):
    rng = np.random.default_rng(4)
    slope = -np.tan(np.radians(35.0))
    x, z = rng.uniform(-0.07, 0.07, (2, 60_000))
    y = rng.uniform(-0.012, 0.012, x.size)
    # the bed of a tilted drum is not level along its axis
    rises = 0.5 * y if tilted else 0.0
    inside = (z < slope * x + rises) & (np.hypot(x, z) < 0.072)
    bed = grains(np.column_stack([x, y, z - RADIUS_M])[inside])
    assert drums.frame_angle(bed, tilted) == pytest.approx(35.0, abs=0.6)


@pytest.mark.usefixtures("rolling_law")
@pytest.mark.filterwarnings("ignore:a wall turns")  # of the law budget
@pytest.mark.parametrize(
    ("grain", "wall"), [("sphere", "cover"), ("wheat", "standing")]
)
def test_a_small_drum_is_filled_among_the_grains_that_lie_there_and_turns(
    monkeypatch, grain, wall
):
    monkeypatch.setattr(drums, "SPUN_S", {False: 0.1, True: 0.1})
    monkeypatch.setattr(drums, "FRAMES", {False: 2, True: 2})
    monkeypatch.setattr(drums, "REGION_M", (0.02, 0.011))
    simulation = drums.drum(
        Contents(0.4, 0.1, 0.5), 1, False, 0.01, grains=250, grain=grain, wall=wall
    )
    assert 200 < simulation.n_bodies <= 250
    assert drums.DRUM.contains(simulation.positions).all()
    assert len(drums.turned(simulation, False, grain, wall)) == 2
    assert simulation.angular_velocities[:, 1].mean() != 0.0
    rays = np.random.default_rng(2).normal(size=(20_000, 3))
    surface = (
        rays / np.linalg.norm(rays, axis=1)[:, None] * drums.of_shape(grain, 0.002)
    )
    for k, top in enumerate(drums.seen(simulation, grain).tops_m[:9]):
        turned = (
            simulation.scales[k]
            * surface
            @ rotation_matrix(simulation.quaternions[k]).T
        )
        expected = simulation.positions[k, 2] + turned[:, 2].max()
        assert top == pytest.approx(expected, abs=2e-5)


def test_a_grain_is_thrown_where_it_overlaps_no_other():
    place = np.zeros((1, 3))
    radii = np.array([0.03])
    found = drums.thrown(place, radii, np.full(300, 4.0), np.random.default_rng(1))
    assert len(found) > 200
    centres = np.vstack([place, [centre for _size, centre in found]])
    radii = np.append(radii, np.full(len(found), 0.002))
    gaps = np.linalg.norm(centres[:, None] - centres, axis=2) - radii - radii[:, None]
    assert gaps[~np.eye(len(radii), dtype=bool)].min() > 0.0
    assert (np.hypot(centres[1:, 0], centres[1:, 2]) + 0.002).max() <= drums.REGION_M[0]
    assert (np.abs(centres[1:, 1]) + 0.002).max() <= drums.REGION_M[1]


def test_the_rate_is_the_slope_of_the_mass_that_left_in_the_middle():
    # 2,000 a second
    left_s = np.concatenate([0.5 + np.arange(1000) / 2000.0, np.full(50, np.inf)])
    masses_g = np.full(1050, 0.04)
    assert discharges.rate_g_s(left_s, masses_g, 1.8) == pytest.approx(80.0, rel=0.005)
    slow_end = np.concatenate([left_s[:900], left_s[899] + 0.01 * np.arange(1, 151)])
    assert discharges.rate_g_s(slow_end[:1000], masses_g[:1000], 1.8) == pytest.approx(
        80.0, rel=0.02
    )


@pytest.mark.usefixtures("rolling_law")
def test_grains_rest_over_the_plug_and_run_out_when_it_is_drawn(monkeypatch):
    monkeypatch.setattr(discharges, "FLOWING_S", 0.5)
    simulation = discharges.closed(Contents(0.3, 0.05, 0.5), 1, 0.1, grains=250)
    left_s = discharges.opened(simulation)
    assert (left_s > discharges.SETTLED_S).all()
    gone = np.isfinite(left_s)
    assert 10 < gone.sum() < 250  # the others lie on the plate
    assert (simulation.positions[~gone, 2] > 0.0).all()
    assert (np.hypot(*simulation.positions[~gone, :2].T) < 0.04).all()


def test_a_seed_scatters_by_more_than_the_population_of_two():
    pair = [24.0, 25.5]
    half = pd.Series([statistics.pstdev(pair)])
    assert half[0] == pytest.approx(0.75)
    assert compare.seed_scatter(half, 2)[0] == pytest.approx(statistics.stdev(pair))
    five = [24.0, 25.5, 23.0, 26.0, 24.5]
    scatter = compare.seed_scatter(pd.Series([statistics.pstdev(five)]), 5)
    assert scatter[0] == pytest.approx(statistics.stdev(five))


def test_equal_engines_have_the_chi_squared_of_their_number_of_rows():
    """Two engines that only differ by seeds: the judgement must not find a difference."""
    rng = np.random.default_rng(6)
    n_rows = 4_000
    truth = rng.uniform(15.0, 35.0, (n_rows, 1))
    ours = truth + rng.normal(0.0, 0.9, (n_rows, 2))
    theirs = truth + rng.normal(0.0, 0.75, (n_rows, 2))
    both = pd.DataFrame(
        {
            "angle_deg": ours.mean(axis=1),
            "seeds": 2,
            "seeds_sd": ours.std(axis=1, ddof=1),
            "aor": theirs.mean(axis=1),
            "aor_std": theirs.std(axis=1),
            "n_ok": 2,
        }
    )
    both["difference"] = both["angle_deg"] - both["aor"]
    both["seeds_sd_theirs"] = compare.seed_scatter(both["aor_std"], both["n_ok"])
    assert compare.scatters("row", both) == pytest.approx((0.9, 0.75), rel=0.04)
    judgement = compare.judged("row", both)
    chi_squared = float(re.search(r"chi squared (\d+) on 4000", judgement).group(1))
    # The standard deviation of chi squared is 89, and the scatters are estimates, too.
    assert chi_squared == pytest.approx(n_rows, abs=600)


def test_the_page_has_the_numbers_of_the_kept_tables():
    page = (lifted_piles.HERE / "README.md").read_text()
    both = pd.read_csv(ROOT / compare.PUBLISHED / "compared_row.csv")
    ours, theirs = compare.scatters("row", both)
    equal = np.sqrt((ours**2 + theirs**2) / 2)
    chi_squared = (both["difference"] ** 2).sum() / equal**2
    assert f"scatters by {ours:.2f} degrees here and by {theirs:.2f} there" in page
    assert f"equal engines would differ by {equal:.2f}" in page
    assert f"is {chi_squared:.0f} on {len(both)}" in page
    drums_there = pd.read_csv(ROOT / compare.PUBLISHED / "compared_drum.csv")
    ours, theirs = compare.scatters("drum", drums_there)
    assert (
        f"drum scatters by {ours:.2f} degrees here\nand by {theirs:.2f} there" in page
    )
    rates = pd.read_csv(ROOT / compare.PUBLISHED / "compared_discharge.csv")
    ours, theirs = compare.scatters("discharge", rates)
    assert (
        f"discharge scatters by {ours:.1f} % here and by {theirs:.1f} % there" in page
    )


def test_records_without_an_engine_say_so(monkeypatch, tmp_path):
    for number, engine in enumerate(({}, {"engine": "abc"})):
        record = {"row": number, "angle_deg": 20.0, **engine}
        path = tmp_path / f"row_{number}_seed_1_modulus_1.json"
        path.write_text(json.dumps(record))
    monkeypatch.setattr(campaign, "OUT", tmp_path)
    monkeypatch.setattr(campaign, "PUBLISHED", tmp_path)
    assert campaign.predictions("row")["engine"].tolist() == ["not recorded", "abc"]


def test_further_places_fill_the_box_away_from_the_drums():
    """The first is as far from all drums as any place of a fine grid, but for its step."""
    unit = (
        (more_places.places() - more_places.LOW) / (more_places.HIGH - more_places.LOW)
    ) ** more_places.POWERS
    assert np.all((unit >= 0.0) & (unit <= 1.0))
    known = drums.rows(tilted=False)[list(Contents._fields)].to_numpy()
    known = (known - more_places.LOW) / (more_places.HIGH - more_places.LOW)
    known = known**more_places.POWERS
    axis = np.linspace(0.0, 1.0, 21)
    grid = np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 3)

    def distance(points):
        steps = points[:, np.newaxis] - known
        return np.sqrt((steps**2).sum(axis=-1)).min(axis=1)

    assert distance(unit[:1])[0] > distance(grid).max() - 0.1
    between = np.linalg.norm(unit[:, np.newaxis] - unit, axis=-1)
    assert between[np.triu_indices(len(unit), 1)].min() > 0.25
