"""Meshes of labels."""

import numpy as np
import pytest

import isobrick


@pytest.fixture(scope="module")
def cells():
    return isobrick.synth("cells", shape=(40, 45, 50), dtype="uint16")


def volume_of(mesh):
    a, b, c = (mesh.vertices[mesh.faces[:, i]].astype("f8") for i in range(3))
    return np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6


def same(a, b):
    return np.array_equal(a.vertices, b.vertices) and np.array_equal(a.faces, b.faces)


def test_each_label_has_a_closed_mesh(cells):
    meshes = isobrick.extract_labels(cells)
    assert list(meshes) == sorted(set(np.unique(cells)) - {0})
    for label, mesh in meshes.items():
        sides = np.concatenate([mesh.faces[:, [i, (i + 1) % 3]] for i in range(3)])
        forward = set(map(tuple, sides.tolist()))
        assert len(forward) == len(sides)
        assert forward == {(b, a) for a, b in forward}
        count = np.count_nonzero(cells == label)
        assert volume_of(mesh) == pytest.approx(count, rel=0.5, abs=3)
        # In the cells around its samples, in x, y, z.
        inside = np.argwhere(cells == label)[:, ::-1]
        assert (mesh.vertices.min(axis=0) > inside.min(axis=0) - 1).all()
        assert (mesh.vertices.max(axis=0) < inside.max(axis=0) + 1).all()


def test_arrays_of_every_kind_give_the_same(cells, tmp_path):
    expected = isobrick.extract_labels(cells, smooth=2)
    for array in (
        cells.astype("int64"), cells.astype("uint64"), cells.astype("float64"),
        np.asfortranarray(cells), cells.astype("int32")[::-1][::-1],
    ):
        meshes = isobrick.extract_labels(array, smooth=2)
        assert list(meshes) == list(expected)
        assert all(same(meshes[label], expected[label]) for label in expected)
    path = tmp_path / "cells.zarr"
    isobrick.convert(cells, path, brick=16, downsampling="mode")
    volume = isobrick.open(path)
    for meshes in (volume.extract_labels(smooth=2), isobrick.extract_labels(volume, smooth=2)):
        assert all(same(meshes[label], expected[label]) for label in expected)


@pytest.mark.parametrize(
    "dtype, first", [("uint64", 2**60), ("int64", 2**60), ("uint64", 2**63), ("uint64", 2**64 - 200)]
)
def test_labels_beyond_doubles(cells, dtype, first, tmp_path):
    expected = isobrick.extract_labels(cells)
    far = np.where(cells > 0, cells.astype(dtype) + np.array(first, dtype), 0).astype(dtype)
    path = tmp_path / "far.zarr"
    isobrick.convert(far, path, brick=16, downsampling="mode")
    volume = isobrick.open(path)
    assert volume.dtype == far.dtype
    assert np.array_equal(volume[:], far)
    for source in (far, volume):
        meshes = isobrick.extract_labels(source)
        assert list(meshes) == [label + first for label in expected]
        assert all(same(meshes[label + first], expected[label]) for label in expected)
        assert list(isobrick.extract_labels(source, [first + 7])) == [first + 7]
    with pytest.raises(isobrick.Error, match="no float64"):
        volume.extract(0.5)


def test_lazy_arrays_are_read_by_blocks(cells):
    dask = pytest.importorskip("dask.array")
    expected = isobrick.extract_labels(cells, [3, 7])
    meshes = isobrick.extract_labels(dask.from_array(cells, chunks=16), [3, 7])
    assert all(same(meshes[label], expected[label]) for label in (3, 7))


def test_choices(cells):
    everything = isobrick.extract_labels(cells)
    assert list(isobrick.extract_labels(cells, 7)) == [7]
    assert list(isobrick.extract_labels(cells, np.array([9, 7]))) == [7, 9]
    assert same(isobrick.extract_labels(cells, 7)[7], everything[7])
    assert 0 in isobrick.extract_labels(cells, background=7)
    assert 7 not in isobrick.extract_labels(cells, background=7)
    part = isobrick.extract_labels(cells, roi=np.s_[:10, :10, :10])
    assert 0 < len(part) < len(everything)
    scaled = isobrick.extract_labels(cells, 7, spacing=(1, 2, 3), unit="um")[7]
    assert scaled.unit == "micrometer"
    assert np.allclose(scaled.vertices, everything[7].vertices * (1, 2, 3))


def test_what_makes_no_sense_is_refused(cells):
    for labels, error in (
        (999, ValueError), ([], ValueError), (2**60, ValueError), ([1.5], TypeError),
        ("all", TypeError),
    ):
        with pytest.raises(error):
            isobrick.extract_labels(cells, labels)
    with pytest.raises(ValueError, match="smooth"):
        isobrick.extract_labels(cells, smooth=7)
    with pytest.raises(isobrick.Error, match="no label image"):
        isobrick.extract_labels(cells + np.float32(0.5))
    with pytest.raises(isobrick.Error, match="no float64"):
        isobrick.extract_labels(np.full((4, 4, 4), 2**60 + 1), nodata=0)
    with pytest.raises(ValueError, match="labels must be at most"):
        isobrick.extract_labels(cells, 2**64)
    with pytest.raises(ValueError, match="no label 18446744073709551615"):
        isobrick.extract_labels(cells, 2**64 - 1)


def test_the_largest_and_the_smallest_label():
    for dtype in ("uint64", "int64"):
        ends = np.iinfo(dtype)
        array = np.zeros((4, 4, 8), dtype)
        array[..., :3], array[..., 5:] = ends.max, ends.min + 1
        assert list(isobrick.extract_labels(array)) == [ends.min + 1, ends.max]
        meshes = isobrick.extract_labels(array, background=ends.max)
        assert list(meshes) == sorted([0, ends.min + 1])
        assert list(isobrick.extract_labels(array, [ends.max])) == [ends.max]
    array[..., 5:] = ends.min
    assert list(isobrick.extract_labels(array)) == [-(2**63), 2**63 - 1]


def test_label_images_are_known(tmp_path):
    path = tmp_path / "cells.zarr"
    isobrick.synth("cells", path, shape=(40, 40, 40), dtype="uint8")
    assert isobrick.info(path)["labels"] == {}
    isobrick.synth("sphere", tmp_path / "ball.zarr", shape=(40, 40, 40))
    assert isobrick.info(tmp_path / "ball.zarr")["labels"] is None
