"""Surfaces of NumPy arrays: types, strides, place in world space, missing samples, bad input."""

import gc
import threading

import numpy as np
import pytest

import isobrick
from conftest import area, ball, is_closed, same, signed_volume

TYPES = ["uint8", "int8", "uint16", "int16", "uint32", "int32", "float32", "float64"]


@pytest.mark.parametrize("dtype", TYPES)
def test_a_ball_of_every_type_is_closed_and_has_its_size(dtype):
    field = (ball(dtype=np.float64) * 2 + 60.5).astype(dtype)
    mesh = isobrick.extract(field, 60 if dtype[0] != "f" else 60.5)
    assert is_closed(mesh.faces)
    assert mesh.vertices.dtype == np.float32 and mesh.faces.dtype == np.uint32
    assert signed_volume(mesh.vertices, mesh.faces) == pytest.approx(4 / 3 * np.pi * 15**3, rel=0.05)
    assert area(mesh.vertices, mesh.faces) == pytest.approx(4 * np.pi * 15**2, rel=0.15)


def test_columns_are_x_y_z_and_arrays_z_y_x():
    field = np.zeros((5, 9, 17), np.float32)
    field[2, 4, 8] = 1
    mesh = isobrick.extract(field, 0.5)
    assert mesh.vertices.mean(0) == pytest.approx([8, 4, 2])
    mesh = isobrick.extract(field, 0.5, spacing=(0.5, 2, 10), origin=(100, 0, -1))
    assert mesh.vertices.mean(0) == pytest.approx([104, 8, 19])
    assert np.ptp(mesh.vertices, axis=0) == pytest.approx([0.5, 2, 10])
    turned = isobrick.extract(field, 0.5, direction=[[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    assert turned.vertices.mean(0) == pytest.approx([-4, 8, 2])
    assert signed_volume(turned.vertices, turned.faces) > 0
    mirrored = isobrick.extract(field, 0.5, direction=np.diag([-1, 1, 1]))
    assert signed_volume(mirrored.vertices, mirrored.faces) > 0


@pytest.mark.parametrize("dtype", ["uint8", "int16", "float32", "float64"])
def test_strides_never_show(dtype):
    field = (ball(dtype=np.float64) * 2).astype(dtype)
    expected = isobrick.extract(field, 3, normals=True)
    assert len(expected) > 1000
    spread = np.zeros((80, 51, 180), dtype)
    spread[::2, 1:, 2::3] = field
    structured = np.zeros(field.shape, [("tag", "u1"), ("value", dtype)])
    structured["value"] = field
    views = [
        np.asfortranarray(field),
        spread[::2, 1:, 2::3],
        np.ascontiguousarray(field[::-1, :, ::-1])[::-1, :, ::-1],
        np.ascontiguousarray(field.transpose(1, 2, 0)).transpose(2, 0, 1),
        structured["value"],
    ]
    for view in views:
        assert same(isobrick.extract(view, 3, normals=True), expected)


def test_read_only_arrays_and_bool():
    field = ball()
    expected = isobrick.extract(field, 1)
    field.flags.writeable = False
    assert same(isobrick.extract(field, 1), expected)
    inside = field > 1
    assert same(isobrick.extract(inside, 0.5), isobrick.extract(inside.astype("u1"), 0.5))


def test_repeated_samples_are_read_by_blocks():
    plane = ball((40, 40, 40))[20]
    wide = np.broadcast_to(plane, (50, 40, 40))
    assert same(isobrick.extract(wide, 1), isobrick.extract(wide.copy(), 1))
    point = np.broadcast_to(np.float32(1), (50, 40, 40))
    assert len(isobrick.extract(point, 0.5)) == 0


def test_a_region_is_given_by_slices():
    field = ball()
    part = isobrick.extract(field, 1, roi=np.s_[10:30, :, 5:-5])
    assert part.vertices[:, 2].min() >= 10 and part.vertices[:, 2].max() <= 29
    assert same(isobrick.extract(field, 1, roi=np.s_[:]), isobrick.extract(field, 1))


def test_missing_samples_leave_a_hole():
    field = ball()
    mask = np.ones(field.shape, bool)
    mask[:, :, 30:] = False
    with_mask = isobrick.extract(field, 1, mask=mask)
    assert 0 < len(with_mask) < len(isobrick.extract(field, 1))
    assert with_mask.vertices[:, 0].max() <= 29
    holes = np.where(mask, field, np.float32(-999))
    assert same(isobrick.extract(holes, 1, nodata=-999), with_mask)
    nan = np.where(mask, field, np.float32(np.nan))
    assert same(isobrick.extract(nan, 1), with_mask)


def test_options():
    field = ball()
    mesh = isobrick.extract(field, 1, normals=True)
    assert np.linalg.norm(mesh.normals, axis=1) == pytest.approx(1, abs=1e-5)
    out = mesh.vertices - mesh.vertices.mean(0)
    assert (np.einsum("ij,ij->i", out, mesh.normals) > 0).all()
    below = isobrick.extract(field, 1, inside="below")
    assert signed_volume(below.vertices, below.faces) < 0
    whole = np.round(field)
    assert len(isobrick.extract(whole, 1, drop_degenerate=True)) < len(isobrick.extract(whole, 1))
    noise = np.random.default_rng(1).random((9, 9, 9))
    assert not same(
        isobrick.extract(noise, 0.5), isobrick.extract(noise, 0.5, topology="trilinear")
    )
    with pytest.raises(isobrick.UsageError, match="trilinear"):
        isobrick.extract(noise, 0.5, topology="other")
    for threads in (1, 3):
        assert same(isobrick.extract(field, 1, normals=True, threads=threads, memory="64M"), mesh)


def test_an_extractor_keeps_the_ranges():
    field = ball()
    extractor = isobrick.Extractor(field, unit="mm")
    assert extractor.range is None and extractor.shape == field.shape
    for isovalue in (1, 5, -3.5):
        mesh = extractor.extract(isovalue)
        assert same(mesh, isobrick.extract(field, isovalue)) and mesh.unit == "millimeter"
    assert extractor.range == (field.min(), field.max())


def test_a_surface_streams_to_a_file(tmp_path):
    field = ball()
    report = isobrick.Extractor(field).save(tmp_path / "a.ply", 1)
    mesh = isobrick.extract(field, 1)
    assert report == {"vertices": len(mesh.vertices), "faces": len(mesh)}
    mesh.save(tmp_path / "b.ply")
    assert (tmp_path / "b.ply").stat().st_size == (tmp_path / "a.ply").stat().st_size
    with pytest.raises(isobrick.UsageError, match="exists"):
        isobrick.Extractor(field).save(tmp_path / "a.ply", 1)


@pytest.mark.parametrize(
    "array, what",
    [
        (np.zeros((4, 4)), "three axes"),
        (np.zeros((2, 2, 2, 2)), "three axes"),
        (np.zeros((0, 4, 4)), "no samples"),
        (np.zeros((4, 4, 4), object), "object"),
        (np.zeros((4, 4, 4), complex), "complex128"),
        (np.zeros((4, 4, 4), np.int64), "int64"),
        (np.zeros((4, 4, 4), np.float16), "float16"),
        (np.zeros((4, 4, 4), ">f4"), "newbyteorder"),
        (np.zeros((4, 4, 4), "M8[s]"), "datetime64"),
        (np.ma.zeros((4, 4, 4)), "MaskedArray"),
        ("text", "three axes"),
        (None, "three axes"),
        ([[["a"]]], "dtype <U1"),
    ],
)
def test_arrays_that_are_no_volumes(array, what):
    with pytest.raises((TypeError, ValueError), match=what) as error:
        isobrick.extract(array, 0.5)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "arguments, what",
    [
        ({"isovalue": np.nan}, "NaN"),
        ({"isovalue": "otso"}, "no isovalue"),
        ({"isovalue": None}, "number"),
        ({"isovalue": 1, "mask": np.ones((2, 2, 2), bool)}, "shape"),
        ({"isovalue": 1, "mask": np.ones((40, 50, 60))}, "bool"),
        ({"isovalue": 1, "mask": np.broadcast_to(True, (40, 50, 60))}, "copied"),
        ({"isovalue": 1, "spacing": (1, 1)}, "3 numbers"),
        ({"isovalue": 1, "spacing": (1, 1, 0)}, "positive"),
        ({"isovalue": 1, "spacing": 3}, "3 numbers"),
        ({"isovalue": 1, "origin": (1, np.inf, 1)}, "finite"),
        ({"isovalue": 1, "direction": np.ones((3, 3))}, "orthonormal"),
        ({"isovalue": 1, "roi": np.s_[50:]}, "no samples"),
        ({"isovalue": 1, "roi": np.s_[::2]}, "step"),
        ({"isovalue": 1, "roi": (1, 2, 3)}, "slices"),
        ({"isovalue": 1, "unit": "hours"}, "unit of length"),
        ({"isovalue": 1, "inside": "left"}, "inside"),
        ({"isovalue": 1, "memory": 1000}, "too small"),
        ({"isovalue": 1, "memory": "much"}, "memory"),
        ({"isovalue": 1, "threads": -1}, "threads"),
        ({"isovalue": 1, "threads": 1.5}, "threads"),
        ({"isovalue": 1, "progress": 3}, "progress"),
    ],
)
def test_requests_that_make_no_sense(arguments, what):
    with pytest.raises((TypeError, ValueError), match=what) as error:
        isobrick.extract(ball(), **arguments)
    assert "\n" not in str(error.value)


def test_exceptions_are_those_of_python():
    assert issubclass(isobrick.UsageError, (isobrick.Error,)) and issubclass(
        isobrick.UsageError, ValueError
    )
    assert issubclass(isobrick.DamageError, OSError)
    assert issubclass(isobrick.Error, RuntimeError)


def test_an_extractor_outlives_its_array():
    extractor = isobrick.Extractor(ball().copy(), mask=np.ones((40, 50, 60), bool))
    gc.collect()
    garbage = [np.full((40, 50, 60), 7, np.float32) for _ in range(4)]
    assert same(extractor.extract(1), isobrick.extract(ball(), 1))
    del garbage


def test_threads_share_an_extractor():
    field = ball((80, 80, 80), 30)
    extractor = isobrick.Extractor(field)
    meshes = {}
    threads = [
        threading.Thread(target=lambda i=i: meshes.__setitem__(i, extractor.extract(i)))
        for i in range(6)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for i, mesh in meshes.items():
        assert same(mesh, isobrick.extract(field, i))
    assert len(meshes) == 6


def test_edge_cases():
    assert len(isobrick.extract(np.zeros((1, 1, 1), np.float32), 0.5)) == 0
    assert len(isobrick.extract(np.zeros((1, 5, 7), np.uint8), 0.5, normals=True)) == 0
    assert len(isobrick.extract(ball(), np.inf)) == 0


def test_caps_close_what_the_border_cuts():
    field = np.zeros((20, 24, 28), np.float32)
    field[:, :, 10:] = 1
    mesh = isobrick.extract(field, 0.5, cap=True)
    assert mesh.measure().volume == pytest.approx(17.5 * 23 * 19)
    assert isobrick.extract(field, 0.5).measure().volume is None
    field[8:10, 9:11, 18:20] = np.nan
    holed = isobrick.extract(field, 0.5, cap=True).measure()
    assert holed.components == 2 and holed.volume == pytest.approx(17.5 * 23 * 19 - 27)
    assert isobrick.extract(np.ones((3, 4, 5), "u1"), 1, cap=True).measure().volume == 2 * 3 * 4
    steps = np.repeat(np.arange(6, dtype="u1"), 4)[:, None, None] * np.ones((1, 20, 22), "u1")
    kept = isobrick.extract(steps, 3, cap=True, drop_degenerate=True)
    assert kept.measure().volume == pytest.approx(21 * 19 * (23 - 12))
    assert len(kept) < len(isobrick.extract(steps, 3, cap=True))
