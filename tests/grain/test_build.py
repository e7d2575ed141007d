"""Shapes: closed forms of spheres and ellipsoids, dense meshes as slow twins, meshes that must be refused."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from export.jobs import THREE
from known import is_known
from refusals import input_error

from repose.dem.rotations import sphere_directions
from repose.grain import build, support_fit
from repose.grain.mesh import move_to_principal_pose
from repose.grain.settings import GrainSettings

BARREL_M = np.array([[7.399, 0.940, 0.940], [3.171, 4.745, 4.000]]) * 1e-3


def turned(mesh, seed=1, shift=(30.0, -12.0, 5.0)):
    turn = trimesh.transformations.random_rotation_matrix(
        np.random.default_rng(seed).random(3)
    )
    turn[:3, 3] = shift
    return mesh.copy().apply_transform(turn)


def saved(mesh, tmp_path):
    path = tmp_path / "scan.stl"
    mesh.export(path)
    return path


def barrel_mesh(subdivisions=5):
    n = trimesh.creation.icosphere(subdivisions=subdivisions).vertices
    return trimesh.convex.convex_hull(
        sum(n * s**2 / np.linalg.norm(n * s, axis=1)[:, None] for s in BARREL_M) * 1e3
    )


def test_ellipsoids_are_recognised_through_the_file_whatever_their_pose(tmp_path):
    path = saved(turned(build.ellipsoid_mesh([21.14, 11.37, 9.88])), tmp_path)
    particle = build.fit_particle(build.load_mesh(path), 840.47)
    assert particle.kind == "ellipsoid"
    np.testing.assert_allclose(
        particle.semi_axes_m, [[10.57e-3, 5.685e-3, 4.94e-3]], rtol=1e-6
    )
    a, b, c = particle.semi_axes_m[0]
    assert particle.volume_m3 == pytest.approx(4 / 3 * math.pi * a * b * c)
    assert particle.mass_kg == pytest.approx(840.47 * particle.volume_m3)
    expected = (
        particle.mass_kg / 5 * np.array([b * b + c * c, a * a + c * c, a * a + b * b])
    )
    np.testing.assert_allclose(particle.inertia_kg_m2, expected)
    assert particle.bounding_radius_m == pytest.approx(a)
    # The facets lie inside the ellipsoid.
    assert 0.99 < particle.mesh_volume_m3 / particle.volume_m3 < 1
    assert 0 < particle.deviation_rms_m < particle.deviation_max_m < 2e-5
    path = saved(turned(build.ellipsoid_mesh([12.0, 12.0, 12.0])), tmp_path)
    particle = build.fit_particle(build.load_mesh(path), 1000.0)
    np.testing.assert_allclose(particle.semi_axes_m, 6e-3, rtol=1e-6)
    mesh = turned(
        trimesh.creation.icosphere(subdivisions=3, radius=0.5), shift=(0, 0, 0)
    )
    mesh.apply_scale([20.0, 12.0, 9.0])
    particle = build.fit_particle(move_to_principal_pose(mesh), 1000.0)
    assert particle.kind == "ellipsoid"
    np.testing.assert_allclose(particle.semi_axes_m, [[10e-3, 6e-3, 4.5e-3]], rtol=1e-5)


@pytest.mark.parametrize("split", [(1.0,), (0.3, 0.7), (0.2, 0.5, 0.3)])
def test_volume_integrals_of_split_ellipsoids(split):
    """Shares of one ellipsoid add up to it, so the numerical integrals have a closed form."""
    axes = np.array([10.0, 6.0, 4.0])
    volume, moments = support_fit.volume_integrals(np.outer(split, axes))
    exact = 4 / 3 * math.pi * axes.prod()
    assert volume == pytest.approx(exact, rel=1e-10)
    np.testing.assert_allclose(moments, exact / 5 * axes**2, rtol=1e-10)


@pytest.mark.parametrize(
    ("a", "b", "radius"), [(4.0, 2.0, 5.0), (9.0, 1.0, 5.0), (12.0, 0.25, 5.0)]
)
def test_volume_of_spheroid_plus_ball(a, b, radius):
    """Steiner's formula for a spheroid plus a ball: V + r S + r^2 int h dOmega + 4/3 pi r^3."""
    e = math.sqrt(a**2 - b**2)
    spheroid = 4 / 3 * math.pi * a * b**2
    surface = 2 * math.pi * b**2 * (1 + a**2 / (b * e) * math.asin(e / a))
    mean_support = (a + b**2 / e * math.asinh(e / b)) / 2
    exact = (
        spheroid
        + radius * surface
        + radius**2 * 4 * math.pi * mean_support
        + 4 / 3 * math.pi * radius**3
    )
    for turn in range(3):
        volume, _ = support_fit.volume_integrals(
            np.array([[radius] * 3, np.roll([a, b, b], turn)])
        )
        assert volume == pytest.approx(exact, rel=1e-6)


def test_integrals_and_fit_of_a_barrel_are_those_of_its_dense_mesh(tmp_path):
    mesh = barrel_mesh()
    volume, moments = support_fit.volume_integrals(BARREL_M)
    assert volume * 1e9 == pytest.approx(mesh.volume, rel=2e-3)
    # The same particle as in the measured mass: 1.25 g at 840.47 kg/m3.
    assert 840.47 * volume == pytest.approx(1.25e-3, rel=1e-3)
    inertia = np.diag(mesh.moment_inertia) * 1e-15
    np.testing.assert_allclose(moments.sum() - moments, inertia, rtol=4e-3)
    particle = build.fit_particle(
        build.load_mesh(saved(turned(mesh), tmp_path)), 840.47
    )
    assert particle.kind == "smooth"
    assert len(particle.semi_axes_m) == 2
    np.testing.assert_allclose(particle.semi_axes_m, BARREL_M, atol=3e-5)
    assert particle.volume_m3 * 1e9 == pytest.approx(mesh.volume, rel=2e-3)
    assert particle.deviation_max_m < 2e-5
    assert particle.bounding_radius_m == pytest.approx(10.57e-3, rel=1e-4)


def test_support_is_what_the_mesh_says():
    particle = build.fit_particle(move_to_principal_pose(barrel_mesh()), 840.47)
    n = np.random.default_rng(3).normal(size=(4, 50, 3))
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    brute = (n @ barrel_mesh().vertices.T).max(axis=-1) * 1e-3
    np.testing.assert_allclose(particle.support(n), brute, atol=2e-5)
    points = particle.support_point(n)
    expected = particle.support(n)
    np.testing.assert_allclose((points * n).sum(axis=-1), expected, rtol=1e-12)
    # x(n) is the gradient of h, here by central differences of the homogeneous extension.
    step = 1e-6
    for axis, unit in enumerate(np.eye(3)):
        slope = (
            particle.support(n + step * unit) - particle.support(n - step * unit)
        ) / (2 * step)
        np.testing.assert_allclose(points[..., axis], slope, atol=1e-9)


def test_the_support_of_unequal_spheres_is_the_farthest_of_all():
    centres = np.array([[-4.0, 0, 0], [3.0, 1.0, 0], [0, 0, 2.0]]) * 1e-3
    radii = np.array([2.0, 5.0, 3.0]) * 1e-3
    clump = replace(THREE, spheres_m=np.column_stack([centres, radii]))
    n = sphere_directions(200)
    supports = (centres[None] * n[:, None]).sum(axis=-1) + radii
    np.testing.assert_allclose(clump.support(n), supports.max(axis=1), rtol=1e-12)
    farthest = (
        centres[supports.argmax(axis=1)] + radii[supports.argmax(axis=1), None] * n
    )
    np.testing.assert_allclose(clump.support_point(n), farthest, rtol=1e-12)


def test_bounding_radius_of_crossed_components_and_particle_file_round_trip(tmp_path):
    # Farthest point off the axes: brute force over the surface.
    axes = np.array([[8.0, 2.0, 1.0], [2.0, 7.0, 1.0]])
    brute = np.linalg.norm(
        support_fit.support_point(axes, sphere_directions(200_000)), axis=1
    ).max()
    assert support_fit.bounding_radius(axes) == pytest.approx(brute, rel=1e-4)
    assert support_fit.bounding_radius(axes) >= brute
    particle = build.fit_particle(
        move_to_principal_pose(barrel_mesh(4)), 840.47, stl="berry.stl"
    )
    particle.save(tmp_path / "particle.json")
    again = build.Particle.load(tmp_path / "particle.json")
    for name in particle.__dataclass_fields__:
        value = getattr(particle, name)
        if isinstance(value, str):
            assert getattr(again, name) == value
        else:
            np.testing.assert_allclose(getattr(again, name), value, rtol=1e-11)
    is_known("particle.txt", (tmp_path / "particle.json").read_text())


def test_run_takes_the_mean_axes_or_the_users_mesh(tmp_path):
    record = {
        "long_mm": 20.0,
        "major_mm": 12.0,
        "minor_mm": 8.0,
        "density_kg_m3": 1000.0,
    }
    (tmp_path / "berry.json").write_text(json.dumps(record))
    particle = build.run(tmp_path / "berry.json", out_dir=tmp_path / "out")
    np.testing.assert_allclose(particle.semi_axes_m, [[10e-3, 6e-3, 4e-3]], rtol=1e-6)
    assert trimesh.load(tmp_path / "out" / "berry.stl", force="mesh").is_watertight
    scan = saved(turned(barrel_mesh(4)), tmp_path)
    particle = build.run(tmp_path / "berry.json", stl=scan, out_dir=tmp_path / "out")
    assert particle.kind == "smooth"
    assert build.Particle.load(
        tmp_path / "out" / "particle.json"
    ).mass_kg == pytest.approx(particle.mass_kg)


def holed():
    mesh = build.ellipsoid_mesh([20, 12, 9])
    mesh.update_faces(np.arange(len(mesh.faces)) != 7)
    return mesh


def inside_out():
    mesh = build.ellipsoid_mesh([20, 12, 9])
    mesh.invert()
    return mesh


def two(shift=0.0, scale=1.0):
    mesh = build.ellipsoid_mesh([20, 12, 9], 3)
    other = build.ellipsoid_mesh([20, 12, 9], 3)
    return trimesh.util.concatenate(
        [mesh, other.apply_scale(scale).apply_translation([shift, 0, 0])]
    )


@pytest.mark.parametrize(
    ("mesh", "message"),
    [
        (holed, "watertight"),
        (inside_out, "outwards"),
        (lambda: build.ellipsoid_mesh([0.020, 0.012, 0.009]), "millimetres"),
        (lambda: trimesh.creation.torus(10, 3), "convex"),
        (lambda: trimesh.creation.annulus(3, 8, 10), "convex"),
        (holed, "3 edges of one facet"),
        (lambda: two(shift=0.5), "bodies is 2"),
        (lambda: two(shift=30.0), "bodies is 2"),
        (lambda: two(scale=0.4), "bodies is 2"),
        (lambda: two(), "is the body there twice"),
        (lambda: build.ellipsoid_mesh([9, 8, 1e-6]), "shortest side in mm is"),
    ],
)
def test_bad_meshes_are_refused_with_a_reason(tmp_path, mesh, message):
    path = saved(mesh(), tmp_path)
    assert str(path) in str(input_error(message, build.load_mesh, path))


def test_files_with_a_fault_are_mended_where_that_is_safe_else_the_cause_is_named(
    tmp_path,
):
    path = tmp_path / "scan.stl"
    whole = build.ellipsoid_mesh([20, 12, 9], 3)
    binary = whole.export(file_type="stl")
    text = whole.export(file_type="stl_ascii").encode()
    facet = binary[84:134]
    no_facet = binary[84:108] + 2 * binary[108:120] + binary[132:134]

    def count_of(more):
        return (len(whole.faces) + more).to_bytes(4, "little")

    count = count_of(0)
    once_more = count_of(1)
    flat = count_of(2) + binary[84:] + 2 * no_facet
    good = [
        binary[:80] + flat,
        binary[:80] + count_of(2) + binary[84:] + facet + no_facet,
        binary,
        binary + bytes(100),
        *(binary[:80] + once_more + binary[84:] + other for other in (facet, no_facet)),
        b"\xef\xbb\xbf" + text,
        text.replace(b"\n", b"\r"),
        text.replace(b"\n", b" " * 2000 + b"\n", 1),
        b"solid of a facet".ljust(80) + binary[80:],
        b"solid K\xc3\xb6rper" + text[text.index(b"\n") :],
    ]
    good += [text + behind for behind in (b"\x1a", b"\0\0\x1a", b"\nexported by X\n")]
    for content in (*good, text, text.rstrip()[: -len("endsolid")]):
        path.write_bytes(content)
        assert build.load_mesh(path).volume == pytest.approx(whole.volume, rel=1e-6), (
            content[-60:]
        )
    bad = [
        (
            binary + binary,
            "facets is 2561; expected 1280, as its header says: one body",
        ),
        (binary[:-60], "facets is 1278; expected 1280"),
        (text[: len(text) // 2], "cut off|edges of one facet"),
    ]
    (tmp_path / "halves.obj").write_text(
        whole.export(file_type="obj").replace("\nf ", "\ng b\nusemtl b\nf ", 700)
    )
    # a needle closes a facet's split edge
    joint = whole.copy()
    a, b, c = whole.faces[7]
    end = len(whole.vertices)
    joint.vertices = np.vstack([joint.vertices, joint.vertices[[a, b]].mean(axis=0)])
    joint.faces = np.vstack(
        [np.delete(whole.faces, 7, axis=0), [a, end, c], [end, b, c], [a, b, end]]
    )
    joint.export(tmp_path / "joint.ply")
    for name in ("joint.ply", "halves.obj"):
        assert build.load_mesh(tmp_path / name).volume == pytest.approx(
            whole.volume, rel=1e-6
        ), name
    whole.faces[5] = whole.faces[5][::-1]
    bad += [
        (
            whole.export(file_type="stl"),
            "0 of more than two, 3 between facets of which one is turned over",
        )
    ]
    boxes = trimesh.util.concatenate(
        trimesh.creation.box([9] * 3),
        trimesh.creation.box([9] * 3).apply_translation([9, 9, 0]),
    )
    bad += [(boxes.export(file_type="stl"), "1 of more than two, 0 between")]
    bad += [
        (
            text.replace(b"vertex", b"vertex 1,5", 1),
            "numbers is 'vertex 1,5'; expected numbers with a",
        )
    ]
    for name, message in (
        ("scan.step", "not read here.* save it as STL"),
        ("scan.ply", "Not a ply file"),
    ):
        (tmp_path / name).write_text("ISO-10303-21;")
        input_error(message, build.load_mesh, tmp_path / name)
    for content, message in (
        *bad,
        (binary[:80] + count + binary[84:100], "facets is 0"),
        (b"", "facets is 0|no STL|faces is 0"),
    ):
        path.write_bytes(content)
        input_error(message, build.load_mesh, path)


def test_a_scan_in_another_unit_than_the_sizes_is_told(tmp_path):
    grain = {
        "long_mm": 20.0,
        "major_mm": 12.0,
        "minor_mm": 9.0,
        "density_kg_m3": 1000.0,
    }
    options = {"mass_g": None, "particle": "smooth", "spheres": 14, "surface": "smooth"}

    def made(*axes_mm):
        scan = saved(build.ellipsoid_mesh(axes_mm), tmp_path)
        return build.make_configured_particle(
            grain, GrainSettings.model_construct(stl=str(scan), **options)
        )

    for scale, message in (
        (10.0, "shortest side in mm is 90.0; expected near 9,"),
        (0.5, "is 4.5; expected near 9,"),
    ):
        input_error(message, made, 20 * scale, 12 * scale, 9 * scale)
    input_error("middle side in mm is 6.5; expected near 12,", made, 20, 6.5, 6)
    assert made(25.0, 12.0, 9.0).kind == "ellipsoid"


def test_what_is_no_mesh_of_a_smooth_particle_is_refused(tmp_path):
    input_error(
        "smooth",
        build.fit_particle,
        trimesh.creation.box((10, 10, 10)),
        1000.0,
        source="box.stl",
    )
    input_error(r"nowhere\.stl", build.load_mesh, tmp_path / "nowhere.stl")
    (tmp_path / "text.stl").write_text("not a mesh")
    input_error(r"text\.stl", build.load_mesh, tmp_path / "text.stl")
    input_error(r"nowhere\.json", build.Particle.load, tmp_path / "nowhere.json")
    input_error(
        r"nowhere\.json", build.run, tmp_path / "nowhere.json", out_dir=tmp_path
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"kind": "cube"},
            "kind is 'cube'; expected ellipsoid or smooth or multisphere",
        ),
        (
            {"semi_axes_mm": [], "spheres_mm": []},
            r"spheres_mm is \[\]; expected spheres, if semi_axes_mm is empty",
        ),
        (
            {"density_kg_m3": "1000"},
            "density_kg_m3 is '1000'; expected finite numbers in ",
        ),
        ({"density_kg_m3": True}, "density_kg_m3 is True; expected finite numbers in "),
        ({"density_kg_m3": [1000.0]}, r"density_kg_m3 is \[1000.0\]; expected finite "),
        (
            {"inertia_g_mm2": [1.0, 2.0]},
            r"inertia_g_mm2 is \[1.0, 2.0\]; expected finite ",
        ),
        (
            {"inertia_g_mm2": [1.0, 2.0, math.inf]},
            "inertia_g_mm2 is .*; expected finite ",
        ),
    ],
)
def test_a_wrong_file_of_a_particle_is_refused_with_file_key_and_value(
    change, message, tmp_path
):
    ones = np.ones(3)
    particle = build.Particle(
        "ellipsoid", ones[None], 1e3, 1.0, 1e3, ones, 1.0, 0.0, 0.0
    )
    path = tmp_path / "particle.json"
    path.write_text(json.dumps(particle.record() | change))
    input_error(f"^{path}: {message}", build.Particle.load, path)
