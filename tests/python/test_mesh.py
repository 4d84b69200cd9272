"""Meshes: arrays that keep them alive, files, and the objects of other libraries."""

import copy
import errno
import gc
import json
import pickle
import signal
import threading
import time

import numpy as np
import pytest

import isobrick
from conftest import ball, same


def test_arrays_keep_the_mesh_alive():
    mesh = isobrick.extract(ball(), 1, normals=True)
    vertices, normals, faces = mesh.vertices, mesh.normals, mesh.faces
    copies = vertices.copy(), normals.copy(), faces.copy()
    del mesh
    gc.collect()
    garbage = [isobrick.extract(ball(), i, normals=True) for i in range(3)]
    for array, copy in zip((vertices, normals, faces), copies):
        assert np.array_equal(array, copy) and array.base is not None
    del garbage


def test_arrays_are_views():
    mesh = isobrick.extract(ball(), 1)
    assert mesh.normals is None
    first = mesh.vertices[0].copy()
    mesh.vertices[:] += 1
    assert mesh.vertices[0] == pytest.approx(first + 1)
    assert np.from_dlpack(mesh.vertices).ctypes.data == mesh.vertices.ctypes.data
    assert len(mesh) == len(mesh.faces)
    assert "triangles" in repr(mesh) and "normals" not in repr(mesh)


def test_an_empty_mesh():
    mesh = isobrick.extract(ball(), 1000, normals=True)
    assert mesh.vertices.shape == (0, 3) and mesh.faces.shape == (0, 3) and len(mesh) == 0
    assert mesh.normals.shape == (0, 3)


def test_meshes_of_others():
    mesh = isobrick.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], unit="millimeter")
    assert mesh.faces.tolist() == [[0, 1, 2]] and mesh.unit == "millimeter"
    for faces in ([[0, 1, 3]], [[0, 1, -1]], [[0, 1, 0.5]]):
        with pytest.raises((TypeError, ValueError)):
            isobrick.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], faces)
    with pytest.raises(ValueError):
        isobrick.Mesh([[0, 0], [1, 0], [0, 1]], [[0, 1, 2]])


@pytest.mark.parametrize("extension", ["ply", "stl", "obj", "glb", "vtp"])
def test_files(tmp_path, extension):
    mesh = isobrick.extract(ball(), 1, normals=True)
    path = tmp_path / f"a.{extension}"
    mesh.save(path)
    size = path.stat().st_size
    assert size > 10 * len(mesh)
    with pytest.raises(isobrick.UsageError, match="exists"):
        mesh.save(path)
    mesh.save(str(path), force=True)
    assert path.stat().st_size == size


def test_files_that_cannot_be(tmp_path):
    mesh = isobrick.extract(ball(), 1)
    with pytest.raises(ValueError, match="a.xyz"):
        mesh.save(tmp_path / "a.xyz")
    with pytest.raises(FileNotFoundError, match="none/a.ply") as error:
        mesh.save(tmp_path / "none" / "a.ply")
    assert isinstance(error.value, isobrick.FileError) and error.value.errno == errno.ENOENT
    assert "\n" not in str(error.value) and str(error.value).startswith("cannot")
    (tmp_path / "file").write_text("")
    with pytest.raises(NotADirectoryError):
        mesh.save(tmp_path / "file" / "a.ply")
    (tmp_path / "file").unlink()
    mesh.faces[5, 1] = len(mesh.vertices)
    with pytest.raises(ValueError, match="a face names vertex"):
        mesh.save(tmp_path / "a.stl")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("extension", ["ply", "stl", "obj", "glb", "vtp"])
def test_ctrl_c_ends_a_save_and_leaves_no_file(tmp_path, extension):
    side = 600
    z, y, x = np.ogrid[:side, :side, :100]
    mesh = isobrick.extract(((x + y + z) % 3).astype(np.uint8), 0.5, normals=True)
    assert len(mesh) > 10_000_000
    threading.Timer(0.3, signal.raise_signal, [signal.SIGINT]).start()
    begun = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        mesh.save(tmp_path / f"a.{extension}")
        time.sleep(2)
    assert time.monotonic() - begun < 1.5
    assert list(tmp_path.iterdir()) == []


def test_a_compressed_glb_is_smaller(tmp_path):
    mesh = isobrick.extract(ball(), 1, normals=True)
    mesh.save(tmp_path / "plain.glb")
    try:
        mesh.save(tmp_path / "a.glb", compress=True)
    except isobrick.UsageError as error:
        pytest.skip(str(error))  # without meshoptimizer
    mesh.save(tmp_path / "b.glb", compress=True, quantize=True)
    sizes = [(tmp_path / name).stat().st_size for name in ("plain.glb", "a.glb", "b.glb")]
    assert sizes[1] < 0.7 * sizes[0] and sizes[2] < 0.9 * sizes[1]
    isobrick.Extractor(ball()).save(tmp_path / "c.glb", 1, normals=True, compress=True)
    assert (tmp_path / "c.glb").read_bytes() == (tmp_path / "a.glb").read_bytes()


def test_compressed_tiles_are_smaller(tmp_path):
    mesh = isobrick.extract(ball(), 1, normals=True)
    mesh.save(tmp_path / "plain.3dtiles")
    try:
        mesh.save(tmp_path / "a.3dtiles", compress=True)
    except isobrick.UsageError as error:
        pytest.skip(str(error))  # without meshoptimizer
    sizes = [sum(file.stat().st_size for file in (tmp_path / name).rglob("*.glb"))
             for name in ("plain.3dtiles", "a.3dtiles")]
    assert sizes[1] < 0.7 * sizes[0]


def test_levels_of_detail(tmp_path):
    mesh = isobrick.extract(ball(), 1)
    try:
        mesh.save(tmp_path / "a.neuroglancer", levels=2, sharded=True)
    except isobrick.UsageError as error:
        pytest.skip(str(error))  # without Draco
    info = json.loads((tmp_path / "a.neuroglancer" / "info").read_text())
    assert info["@type"] == "neuroglancer_multilod_draco" and "sharding" in info
    mesh.save(tmp_path / "b.neuroglancer")
    assert "sharding" not in json.loads((tmp_path / "b.neuroglancer" / "info").read_text())
    for wrong in ({"levels": 0}, {"levels": 17}, {"levels": "two"}):
        with pytest.raises((isobrick.UsageError, TypeError)):
            mesh.save(tmp_path / "c.neuroglancer", **wrong)
    with pytest.raises(isobrick.UsageError):
        mesh.save(tmp_path / "c.ply", levels=2)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.neuroglancer", "b.neuroglancer"]


def test_saves_3d_tiles(tmp_path):
    mesh = isobrick.extract(ball(), 1, normals=True, unit="mm")
    mesh.save(tmp_path / "a.3dtiles", levels=3)
    tileset = json.loads((tmp_path / "a.3dtiles" / "tileset.json").read_text())
    assert tileset["asset"]["version"] == "1.1"
    levels = sorted(path.name for path in (tmp_path / "a.3dtiles").iterdir() if path.is_dir())
    assert levels[0] == "0" and 1 < len(levels) <= 3
    contents = list((tmp_path / "a.3dtiles").glob("*/*.glb"))
    assert contents and all(b"NORMAL" in path.read_bytes() for path in contents)
    for wrong in ({"levels": 0}, {"levels": 17}, {"sharded": True}):
        with pytest.raises(isobrick.UsageError):
            mesh.save(tmp_path / "b.3dtiles", **wrong)
    with pytest.raises(isobrick.UsageError):
        mesh.save(tmp_path / "a.3dtiles")
    mesh.save(tmp_path / "a.3dtiles", force=True)
    assert [path.name for path in tmp_path.iterdir()] == ["a.3dtiles"]


def test_progress_of_a_save(tmp_path):
    mesh = isobrick.extract(ball(), 1)
    calls = []
    mesh.save(tmp_path / "a.ply", progress=lambda *call: calls.append(call))
    assert calls and calls[-1][0] == "saving" and calls[-1][1] == calls[-1][2]


def test_vtk():
    pytest.importorskip("vtkmodules.vtkCommonDataModel")
    from vtkmodules.util.numpy_support import vtk_to_numpy

    mesh = isobrick.extract(ball(), 1, normals=True, unit="mm")
    vertices, faces, normals = mesh.vertices.copy(), mesh.faces.copy(), mesh.normals.copy()
    data = mesh.to_vtk()
    corners = vtk_to_numpy(data.GetPolys().GetConnectivityArray())
    for shared, array in ((vtk_to_numpy(data.GetPoints().GetData()), mesh.vertices),
                          (vtk_to_numpy(data.GetPointData().GetNormals()), mesh.normals),
                          (corners, mesh.faces)):
        assert shared.ctypes.data == array.ctypes.data
    assert data.GetFieldData().GetAbstractArray("unit").GetValue(0) == "millimeter"
    del mesh, corners, shared, array
    gc.collect()
    garbage = [isobrick.extract(ball(), i, normals=True) for i in range(3)]
    assert np.array_equal(vtk_to_numpy(data.GetPoints().GetData()), vertices)
    assert np.array_equal(vtk_to_numpy(data.GetPointData().GetNormals()), normals)
    assert np.array_equal(vtk_to_numpy(data.GetPolys().GetConnectivityArray()).reshape(-1, 3), faces)
    assert data.GetNumberOfCells() == len(faces)
    assert data.GetCell(5).GetPointIds().GetId(1) == faces[5, 1]
    empty = isobrick.extract(ball(), 1000, normals=True).to_vtk()
    assert empty.GetNumberOfCells() == 0 and empty.GetNumberOfPoints() == 0
    del garbage


@pytest.mark.parametrize("module", ["trimesh", "meshio", "pyvista"])
def test_other_libraries(module):
    pytest.importorskip(module)
    mesh = isobrick.extract(ball(), 1, normals=True)
    other = getattr(mesh, f"to_{module}")()
    points = {"trimesh": "vertices", "meshio": "points", "pyvista": "points"}[module]
    assert np.allclose(getattr(other, points), mesh.vertices)


def test_pickles_of_meshes_and_errors(tmp_path):
    for normals in (True, False):
        mesh = isobrick.extract(ball(), 1, normals=normals, unit="mm")
        for other in (pickle.loads(pickle.dumps(mesh)), copy.deepcopy(mesh)):
            assert same(other, mesh) and other.unit == "millimeter"
            assert other.vertices.ctypes.data != mesh.vertices.ctypes.data
    with pytest.raises(isobrick.FileError) as error:
        mesh.save(tmp_path / "none" / "a.ply")
    other = pickle.loads(pickle.dumps(error.value))
    assert type(other) is type(error.value) and other.errno == errno.ENOENT
    assert str(other) == str(error.value)


def test_units_of_meshes():
    corners, faces = [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]
    assert isobrick.Mesh(corners, faces, unit="mm").unit == "millimeter"
    assert isobrick.Mesh(corners, faces).unit == ""
    for unit in ("hours", 3):
        with pytest.raises((TypeError, ValueError), match="unit"):
            isobrick.Mesh(corners, faces, unit=unit)


def test_copies_of_a_mesh_are_the_same():
    mesh = isobrick.extract(ball(), 1, normals=True)
    assert same(isobrick.Mesh(mesh.vertices, mesh.faces, mesh.normals), mesh)
