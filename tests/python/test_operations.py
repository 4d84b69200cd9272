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
