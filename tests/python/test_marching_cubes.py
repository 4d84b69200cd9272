"""marching_cubes() beside that of scikit-image, on its own examples."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import isobrick
from conftest import area, is_closed, signed_volume

measure = pytest.importorskip("skimage.measure")
draw = pytest.importorskip("skimage.draw")


def both(volume, level=None, **options):
    return (
        isobrick.marching_cubes(volume, level, **options),
        measure.marching_cubes(volume, level, **options),
    )


def assert_alike(ours, theirs, *, tolerance=0.01):
    verts, faces, normals, values = ours
    assert [a.dtype for a in ours[:1] + ours[2:]] == [a.dtype for a in theirs[:1] + theirs[2:]]
    assert [a.ndim for a in ours] == [a.ndim for a in theirs]
    assert len(verts) == len(normals) == len(values)
    assert verts.min(0) == pytest.approx(theirs[0].min(0), abs=1e-4)
    assert verts.max(0) == pytest.approx(theirs[0].max(0), abs=1e-4)
    assert area(verts, faces) == pytest.approx(area(*theirs[:2]), rel=tolerance)
    volume = signed_volume(*theirs[:2])
    assert signed_volume(verts, faces) == pytest.approx(volume, rel=tolerance)
    assert is_closed(faces) == is_closed(theirs[1])


def by_place(arrays):
    """Rows of (vertex, normal, value) in the order of the vertices' places."""
    verts, _, normals, values = arrays
    rows = np.column_stack([np.round(verts, 3), normals, values])
    return rows[np.lexsort(rows[:, :3].T)]


@pytest.fixture
def ellipsoid():
    return draw.ellipsoid(6, 10, 16, levelset=True)


def test_the_same_vertices_normals_and_values(ellipsoid):
    ours, theirs = both(ellipsoid, 0.05)  # no sample equals it
    assert_alike(ours, theirs)
    assert ours[1].dtype == theirs[1].dtype == np.int32
    assert len(ours[0]) == len(theirs[0])
    a, b = by_place(ours), by_place(theirs)
    assert np.abs(a[:, :3] - b[:, :3]).max() < 2e-3
    assert (np.einsum("ij,ij->i", a[:, 3:6], b[:, 3:6]) > 0.9).mean() > 0.99
    assert a[:, 6] == pytest.approx(b[:, 6], rel=1e-4)


@pytest.mark.parametrize("spacing", [(1.0, 10 / 6.0, 16 / 6.0), (2, 2, 2)])
def test_spacing_is_in_the_order_of_the_axes(spacing):
    isotropic = draw.ellipsoid(6, 10, 16, spacing=spacing, levelset=True)
    ours, theirs = both(isotropic, 0.0, spacing=spacing)
    assert_alike(ours, theirs)
    wanted = draw.ellipsoid_stats(6, 10, 16)[1]
    assert measure.mesh_surface_area(ours[0], ours[1]) == pytest.approx(wanted, rel=0.03)


def test_spacing_that_mirrors_and_that_flattens(ellipsoid):
    assert_alike(*both(ellipsoid, 0.0, spacing=(1, -1, 2)))
    for spacing in ((0, 1, 1), (1, np.nan, 1), (1, 1, np.inf), (1, 1, "a"), 3):
        with pytest.raises(ValueError, match="spacing"):
            isobrick.marching_cubes(ellipsoid, 0.0, spacing=spacing)


@pytest.mark.parametrize("direction", ["descent", "ascent"])
def test_winding(ellipsoid, direction):
    for volume in (ellipsoid, -ellipsoid):
        assert_alike(*both(volume, 0.0, gradient_direction=direction))


@pytest.mark.parametrize("step", [1, 2, 3])
def test_step_size(ellipsoid, step):
    volume = draw.ellipsoid(20, 24, 28, levelset=True)
    assert_alike(*both(volume, 0.0, step_size=step))


def test_masks_open_the_surface(ellipsoid):
    mask = np.zeros(ellipsoid.shape, bool)
    mask[4:10, :15, 5:] = True
    ours, theirs = both(ellipsoid, 0.05, mask=mask)
    assert not is_closed(ours[1])
    assert len(ours[0]) == len(theirs[0])
    assert area(*ours[:2]) == pytest.approx(area(*theirs[:2]), rel=0.01)
    assert ours[0].min(0) == pytest.approx(theirs[0].min(0), abs=1e-4)
    assert ours[0].max(0) == pytest.approx(theirs[0].max(0), abs=1e-4)
    everything = isobrick.marching_cubes(ellipsoid, 0.0, mask=np.ones(ellipsoid.shape, bool))
    assert np.array_equal(everything[0], isobrick.marching_cubes(ellipsoid, 0.0)[0])
    with pytest.raises(RuntimeError):
        isobrick.marching_cubes(ellipsoid, 0.0, mask=np.zeros(ellipsoid.shape, bool))


def test_degenerate_triangles(ellipsoid):
    volume = ellipsoid.astype(np.float32)
    assert (volume == 0).any()
    ours, theirs = (f(volume, 0, allow_degenerate=False)
                    for f in (isobrick.marching_cubes, measure.marching_cubes))
    for verts, faces, _, _ in (ours, theirs):
        a, b, c = (verts[faces[:, i]].astype(float) for i in range(3))
        assert np.linalg.norm(np.cross(b - a, c - a), axis=1).min() > 0
    assert area(*ours[:2]) == pytest.approx(area(*theirs[:2]), rel=0.01)


@pytest.mark.parametrize("dtype", ["u1", "i2", "i4", "i8", "f2", "f4", "f8", "?"])
@pytest.mark.parametrize("method", ["lewiner", "lorensen"])
def test_types_and_methods(ellipsoid, dtype, method):
    volume = (ellipsoid > 0) if dtype == "?" else (ellipsoid * 20 + 40).clip(0, 100).astype(dtype)
    level = 0.5 if dtype == "?" else 40.5
    assert_alike(*both(volume, level, method=method), tolerance=0.02)


def test_a_real_volume():
    if not shutil.which("zstd"):
        pytest.skip("no zstd")
    file = Path(__file__).resolve().parents[2] / "data/headsq_quarter_64x64x93_int16.raw.zst"
    data = subprocess.run(["zstd", "-dqc", file], check=True, capture_output=True).stdout
    head = np.frombuffer(data, np.int16).reshape(93, 64, 64)
    ours = isobrick.marching_cubes(head, 500.5, spacing=(1.5, 3.2, 3.2))
    theirs = measure.marching_cubes(head.copy(), 500.5, spacing=(1.5, 3.2, 3.2))
    assert_alike(ours, theirs)
    assert len(ours[0]) == pytest.approx(len(theirs[0]), rel=0.01)


def test_the_default_level_and_strides(ellipsoid):
    assert_alike(*both(ellipsoid))
    turned = ellipsoid.transpose(2, 0, 1)[::-1]
    assert_alike(*both(turned, 0.0))


@pytest.mark.parametrize(
    "arguments",
    [
        {"volume": np.zeros((20, 20)), "level": 0},
        {"volume": np.ones((20, 20, 20)), "level": 2},
        {"volume": np.ones((20, 20, 1)), "level": 0},
        {"volume": [[[1]]], "level": 0},
        {"volume": np.eye(8)[None] * np.ones((8, 1, 1)), "level": 0.5, "spacing": (1, 2)},
        {"volume": np.eye(8)[None] * np.ones((8, 1, 1)), "level": 0.5, "step_size": 0},
        {"volume": np.eye(8)[None] * np.ones((8, 1, 1)), "level": 0.5, "method": "abcd"},
        {"volume": np.eye(8)[None] * np.ones((8, 1, 1)), "level": 0.5, "mask": np.ones((2, 2, 2))},
        {"volume": np.ones((20, 20, 20)), "level": 1},
    ],
)
def test_the_same_exceptions(arguments):
    with pytest.raises((ValueError, RuntimeError)) as theirs:
        measure.marching_cubes(**arguments)
    with pytest.raises(theirs.type):
        isobrick.marching_cubes(**arguments)
