"""convert, index, info, verify, export and synth."""

import numpy as np
import pytest

import isobrick
from conftest import ball, same


def test_arrays_become_stores(tmp_path):
    field = ball()[::-1, :, ::2]
    report = isobrick.convert(
        field, tmp_path / "a.zarr", spacing=(1, 2, 3), origin=(4, 5, 6), unit="um", brick=16,
        index="octree",
    )
    assert report["bytes_in"] == field.nbytes and report["levels"] > 1
    volume = isobrick.open(tmp_path / "a.zarr")
    assert volume.spacing == (1, 2, 3) and volume.origin == (4, 5, 6)
    assert volume.unit == "micrometer"
    assert np.array_equal(volume.read(), field)
    with pytest.raises(isobrick.UsageError, match="exists"):
        isobrick.convert(field, tmp_path / "a.zarr")
    isobrick.convert(field, tmp_path / "a.zarr", force=True, compression=None)
    assert isobrick.open(tmp_path / "a.zarr").info["codec"] == "none"
    isobrick.convert(field, tmp_path / "a.zarr", force=True, compression="packed")
    assert isobrick.open(tmp_path / "a.zarr").info["codec"] == "packed"
    done = isobrick.convert(field, tmp_path / "a.zarr", force=True, compression="auto")
    assert isobrick.open(tmp_path / "a.zarr").info["codec"] == done["codec"]
    assert done["codec_sample"]["bricks"] > 0


def test_recode(tmp_path):
    field = ball()
    isobrick.convert(field, tmp_path / "a.zarr")
    for compression, codec in (("packed", "packed"), (None, "none"), (5, "zstd:5")):
        done = isobrick.recode(tmp_path / "a.zarr", tmp_path / "b.zarr", compression, force=True)
        assert done["codec"] == codec and done["codec_sample"] is None
        volume = isobrick.open(tmp_path / "b.zarr")
        assert volume.info["codec"] == codec
        assert np.array_equal(volume[:], field)
    stages = []
    done = isobrick.recode(
        tmp_path / "a.zarr", tmp_path / "c.zarr.zip",
        progress=lambda stage, done, total: stages.append(stage),
    )
    assert done["codec_sample"]["zstd_bytes"] > 0
    assert isobrick.open(tmp_path / "c.zarr.zip").info["codec"] == done["codec"]
    with pytest.raises(isobrick.UsageError, match="exists"):
        isobrick.recode(tmp_path / "a.zarr", tmp_path / "b.zarr")
    with pytest.raises(isobrick.UsageError, match="input"):
        isobrick.recode(tmp_path / "a.zarr", tmp_path / "a.zarr", force=True)
    with pytest.raises(FileNotFoundError):
        isobrick.recode(tmp_path / "none.zarr", tmp_path / "d.zarr")
    with pytest.raises((isobrick.UsageError, TypeError)):
        isobrick.recode(tmp_path / "a.zarr", tmp_path / "d.zarr", "lz4")


class Lazy:
    """Samples that are read by blocks."""

    def __init__(self, array):
        self.array, self.shape, self.dtype = array, array.shape, array.dtype

    def __getitem__(self, box):
        return self.array[box]


@pytest.mark.parametrize("dtype, stored", [("u1", "f4"), ("i2", "f4"), ("i4", "f8"), ("f4", "f4")])
def test_missing_samples_of_arrays_are_nan_in_stores(tmp_path, dtype, stored):
    field = (ball() * 3 + 60).astype(dtype)
    mask = np.ones(field.shape, bool)
    mask[:, 20:30, 30:] = False
    field[5, 5, 5] = 77
    expected = np.where(mask & (field != 77), field, np.nan).astype(stored)
    for i, array in enumerate((field, np.asfortranarray(field), field[::-1][::-1], Lazy(field))):
        path = tmp_path / f"{i}.zarr"
        isobrick.convert(array, path, mask=mask, nodata=77, memory="64M", brick=16)
        volume = isobrick.open(path)
        assert volume.dtype == np.dtype(stored)
        assert np.array_equal(volume.read(), expected, equal_nan=True)
        mesh = isobrick.extract(array, 60, mask=mask, nodata=77)
        assert len(mesh) and same(volume.extract(60), mesh)
        assert same(isobrick.extract(expected, 60), mesh)
    flags = isobrick.convert(field > 60, tmp_path / "flags.zarr", nodata=0)
    assert flags["levels"] and isobrick.open(tmp_path / "flags.zarr").dtype == np.float32


def test_masks_that_make_no_sense(tmp_path):
    field = ball()
    for mask, what in ((np.ones((2, 2, 2), bool), "shape"), (np.ones(field.shape), "bool")):
        with pytest.raises((TypeError, ValueError), match=what):
            isobrick.convert(field, tmp_path / "a.zarr", mask=mask)
    with pytest.raises(TypeError, match="nodata"):
        isobrick.convert(field, tmp_path / "a.zarr", nodata="none")
    assert list(tmp_path.iterdir()) == []


def test_a_surface_ends_at_a_mask_as_its_cells_do():
    """A cell has triangles where all of its corners are there; scikit-image's mask asks for one."""
    field = ball()
    mask = np.random.default_rng(1).random(field.shape) > 0.02
    cells = np.lib.stride_tricks.sliding_window_view(mask, (2, 2, 2)).all(axis=(3, 4, 5))
    corner = np.zeros(field.shape, bool)
    corner[1:, 1:, 1:] = cells
    ours = isobrick.extract(field, 0.3, mask=mask)
    verts, faces, _, _ = isobrick.marching_cubes(field, 0.3, mask=corner)
    assert len(faces) == len(ours) and 0 < len(ours) < len(isobrick.extract(field, 0.3))
    middles = np.sort(ours.vertices[ours.faces].mean(1).round(2).view("f4,f4,f4").ravel())
    theirs = verts[faces][..., ::-1].mean(1).round(2)
    theirs = np.sort(np.ascontiguousarray(theirs, np.float32).view("f4,f4,f4").ravel())
    assert np.array_equal(middles, theirs)


def test_files_become_stores(tmp_path):
    field = ball()
    field.tofile(tmp_path / "a.raw")
    isobrick.convert(tmp_path / "a.raw", tmp_path / "a.zarr", shape=field.shape, dtype="f4", ome="0.4")
    assert np.array_equal(isobrick.open(tmp_path / "a.zarr").read(), field)
    field.astype(">f4").tofile(tmp_path / "b.raw")
    isobrick.convert(tmp_path / "b.raw", tmp_path / "b.zarr", shape=field.shape, dtype=">f4")
    assert np.array_equal(isobrick.open(tmp_path / "b.zarr").read(), field)


def test_an_index_changes_no_mesh(store):
    before = isobrick.open(store).extract(127.5)
    report = isobrick.index(store, "kdtree", leaf=8)
    assert sum(report["level_bytes"]) > 0 and not report["ranges_added"]
    assert same(isobrick.open(store).extract(127.5), before)
    with pytest.raises(isobrick.UsageError):
        isobrick.index(store, "kdtree")
    with pytest.raises(ValueError, match="kinds"):
        isobrick.index(store, "tree")


def test_verify(store):
    report = isobrick.verify(store)
    assert report["whole"] and report["bricks"] > 0 and report["damages"] == []


def test_info_reads_no_samples(tmp_path):
    field = ball()
    isobrick.convert(field, tmp_path / "a.zarr", spacing=(1, 2, 3))
    isobrick.export(tmp_path / "a.zarr", tmp_path / "a.nrrd")
    info = isobrick.info(tmp_path / "a.nrrd")
    assert info["shape"] == field.shape and info["dtype"] == "float32"
    assert info["spacing"] == (1, 2, 3) and not info["is_store"]


def test_export(store, tmp_path):
    samples = isobrick.open(store).read()
    isobrick.export(store, tmp_path / "a.raw", roi=np.s_[10:20])
    assert np.array_equal(
        np.fromfile(tmp_path / "a.raw", np.uint8).reshape(10, 50, 40), samples[10:20]
    )
    isobrick.open(store).export(tmp_path / "a.nrrd", level=1)
    assert (tmp_path / "a.nrrd").stat().st_size > 30 * 25 * 20
    isobrick.export(store, tmp_path / "a.zarr.zip")
    assert np.array_equal(isobrick.open(tmp_path / "a.zarr.zip").read(), samples)
    with pytest.raises(ValueError, match="whole store"):
        isobrick.export(store, tmp_path / "b.zip", level=1)
    with pytest.raises(ValueError, match="written"):
        isobrick.export(store, tmp_path / "a.txt")


def test_procedural_volumes(tmp_path):
    array = isobrick.synth("sphere", shape=(10, 20, 30), dtype="f4")
    assert array.shape == (10, 20, 30) and array.dtype == np.float32
    isobrick.synth("sphere", tmp_path / "a.zarr", shape=(10, 20, 30), dtype="f4")
    assert np.array_equal(isobrick.open(tmp_path / "a.zarr").read(), array)
    for arguments in ({"kind": "cube", "shape": (2, 2, 2)}, {"kind": "sphere", "shape": (2, 2)},
                      {"kind": "sphere", "shape": (0, 2, 2)}):
        with pytest.raises(ValueError):
            isobrick.synth(**arguments)
