"""Arrays that are not in memory: dask, zarr, h5py, xarray, and anything alike."""

import gc
import threading

import numpy as np
import pytest

import isobrick
from conftest import ball, same


class Recorded:
    """An array that notes what is read of it."""

    def __init__(self, array):
        self.array = array
        self.shape, self.dtype = array.shape, array.dtype
        self.largest = 0
        self.reads = 0

    def __getitem__(self, box):
        block = self.array[box]
        self.largest = max(self.largest, block.size)
        self.reads += 1
        return block


def test_anything_with_shape_dtype_and_getitem():
    field = ball((200, 150, 170), 60)
    array = Recorded(field)
    mesh = isobrick.extract(array, 1, normals=True)
    assert same(mesh, isobrick.extract(field, 1, normals=True))
    assert 0 < array.largest < field.size / 2
    extractor = isobrick.Extractor(array)
    extractor.extract(1)
    reads = array.reads
    assert len(extractor.extract(1000)) == 0 and array.reads == reads
    del array
    gc.collect()
    assert same(extractor.extract(1, normals=True), mesh)


def test_dask_by_blocks():
    da = pytest.importorskip("dask.array")
    field = ball((200, 150, 170), 60)
    read = []

    def block(block_info=None):
        place = block_info[None]["array-location"]
        read.append(tuple(place[0]))
        return field[tuple(slice(*p) for p in place)]

    lazy = da.map_blocks(
        block, chunks=((64, 64, 72), (70, 80), (85, 85)), dtype=field.dtype, meta=field[:0, :0, :0]
    )
    assert same(isobrick.extract(lazy, 1, normals=True), isobrick.extract(field, 1, normals=True))
    assert len(read) == 12, "each chunk is computed once"
    expected = isobrick.extract(field, 1)
    assert same(isobrick.extract(lazy, 1, memory="32M"), expected)
    assert same(isobrick.extract(lazy, 1, memory="12M"), expected)
    with pytest.raises(ValueError, match="1.0 MiB is too small"):
        isobrick.extract(lazy, 1, memory="1M")
    sliced = lazy[::2, 5:, ::-1]
    assert same(isobrick.extract(sliced, 1), isobrick.extract(field[::2, 5:, ::-1], 1))
    with pytest.raises(ZeroDivisionError):
        isobrick.extract(da.map_blocks(lambda b: 1 // 0, lazy, dtype="f4", meta=field[:0, :0, :0]), 1)


def test_threads_share_an_extractor_of_blocks():
    da = pytest.importorskip("dask.array")
    field = ball((100, 90, 80), 30)
    extractor = isobrick.Extractor(da.from_array(field, chunks=25))
    meshes = {}

    def extract(isovalue):
        meshes[isovalue] = extractor.extract(isovalue, memory=f"{20 + 10 * isovalue}M")

    threads = [threading.Thread(target=extract, args=(i,)) for i in range(5)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(same(meshes[i], isobrick.extract(field, i)) for i in range(5))


def test_zarr_in_memory():
    zarr = pytest.importorskip("zarr")
    field = ball((100, 90, 80), 30)
    array = zarr.array(field, chunks=(32, 40, 80))
    assert same(isobrick.extract(array, 1), isobrick.extract(field, 1))


@pytest.mark.parametrize("dtype", ["<f4", ">f4"])
def test_h5py(tmp_path, dtype):
    h5py = pytest.importorskip("h5py")
    field = ball((100, 90, 80), 30)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("a", data=field.astype(dtype), chunks=(32, 32, 32))
        assert same(isobrick.extract(file["a"], 1), isobrick.extract(field, 1))


def test_xarray_gives_the_place():
    xarray = pytest.importorskip("xarray")
    field = ball()
    coords = {
        "depth": ("depth", 10 - 3.0 * np.arange(40), {"units": "mm"}),
        "row": ("row", 2.0 * np.arange(50) + 7, {"units": "mm"}),
        "column": ("column", 0.5 * np.arange(60) - 1, {"units": "mm"}),
    }
    array = xarray.DataArray(field, coords, ("depth", "row", "column"))
    expected = isobrick.extract(
        field, 1, spacing=(0.5, 2, 3), origin=(-1, 7, 10), direction=np.diag([1, 1, -1]), unit="mm"
    )
    mesh = isobrick.extract(array, 1)
    assert same(mesh, expected) and mesh.unit == "millimeter"
    assert mesh.vertices[:, 2].mean() == pytest.approx(10 - 3 * 19.5, abs=0.1)
    plain = isobrick.extract(xarray.DataArray(field), 1)
    assert same(plain, isobrick.extract(field, 1))
    given = isobrick.extract(array, 1, spacing=(1, 1, 1), unit="")
    assert same(given, plain) and given.unit == ""
    uneven = array.assign_coords(row=np.arange(50) ** 2)
    with pytest.raises(ValueError, match="evenly"):
        isobrick.extract(uneven, 1)


def test_xarray_over_dask():
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("dask")
    field = ball()
    lazy = xarray.DataArray(field, dims=("z", "y", "x")).chunk(20)
    assert same(isobrick.extract(lazy, 1), isobrick.extract(field, 1))


def test_xarray_over_a_file_stays_there(tmp_path):
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("zarr")
    field = ball((100, 90, 80), 30)
    xarray.DataArray(field, dims=("z", "y", "x"), name="a").to_dataset().to_zarr(tmp_path / "a")
    array = xarray.open_dataset(tmp_path / "a", engine="zarr", chunks=None)["a"]
    assert same(isobrick.extract(array, 1), isobrick.extract(field, 1))
    assert not array.variable._in_memory


class Exchanged:
    """Memory of another library, by DLPack alone."""

    def __init__(self, array, device=1):
        self.array, self.device = array, device
        self.shape, self.dtype = array.shape, "another library's"

    def __dlpack__(self, stream=None):
        return self.array.__dlpack__()

    def __dlpack_device__(self):
        return self.device, 0

    def __getitem__(self, index):
        raise AssertionError("it was not taken in place")


def test_memory_of_other_libraries_is_read_in_place():
    field = ball()
    assert same(isobrick.extract(Exchanged(field), 1), isobrick.extract(field, 1))
    with pytest.raises(ValueError, match="device"):
        isobrick.extract(Exchanged(field, device=2), 1)


def test_arrays_become_stores_by_blocks(tmp_path):
    da = pytest.importorskip("dask.array")
    field = ball((100, 90, 80), 30)
    report = isobrick.convert(da.from_array(field, chunks=40), tmp_path / "a.zarr", spacing=(1, 2, 3))
    assert report["bytes_in"] == field.nbytes
    volume = isobrick.open(tmp_path / "a.zarr")
    assert np.array_equal(volume.read(), field) and volume.spacing == (1, 2, 3)
    array = Recorded(field)
    isobrick.convert(array, tmp_path / "b.zarr", brick=16, memory="64M")
    assert np.array_equal(isobrick.open(tmp_path / "b.zarr").read(), field)
    assert array.largest < field.size
