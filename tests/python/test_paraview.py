"""The plugin of ParaView, run by its pvpython and pvbatch."""

import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import isobrick
from conftest import ball

ROOT = Path(__file__).resolve().parents[2]
PLUGIN = ROOT / "python/paraview/isobrick.xml"

BEGIN = f"""
import sys
from paraview.simple import *
from paraview import servermanager
from vtkmodules.util.numpy_support import vtk_to_numpy
import numpy as np
import isobrick
LoadPlugin({str(PLUGIN)!r}, remote=False, ns=globals())
path = sys.argv[1]

def vertices(data):
    return vtk_to_numpy(data.GetPoints().GetData())

def faces(data):
    return vtk_to_numpy(data.GetPolys().GetConnectivityArray()).reshape(-1, 3)

def points(data, name):
    return vtk_to_numpy(data.GetPointData().GetArray(name))

def field(data, name):
    array = data.GetFieldData().GetAbstractArray(name)
    return [array.GetValue(i) for i in range(array.GetNumberOfValues())]

def output(source):
    source.UpdatePipeline()
    return source.GetClientSideObject().GetOutputDataObject(0)
"""


def run(script, *arguments, program="pvpython", display=False, **options):
    """Runs a script that prints "done" at its end; returns what it prints as errors."""
    if shutil.which(program) is None:
        pytest.skip(f"{program} is not installed")
    command = [program, "--force-offscreen-rendering", str(script), *map(str, arguments)]
    if display and "DISPLAY" not in os.environ:
        if shutil.which("xvfb-run") is None:
            pytest.skip("there is no display, and xvfb-run is not installed")
        command = ["xvfb-run", "-a", *command]
    done = subprocess.run(command, text=True, capture_output=True, timeout=300, **options)
    assert done.returncode == 0 and "done" in done.stdout.split(), done.stdout + done.stderr
    return done.stderr


@pytest.fixture
def script(tmp_path):
    def write(text):
        path = tmp_path / "script.py"
        begin = BEGIN + ("volume = isobrick.open(path)\n" if "volume." in text else "")
        path.write_text(begin + text + "\nprint('done')\n")
        return path

    return write


def test_surfaces(script, store):
    errors = run(script("""
surface = IsobrickSurface(FileName=path)
data = output(surface)
mesh = volume.extract("otsu", normals=True)
assert vertices(data).tobytes() == mesh.vertices.tobytes()
assert np.array_equal(faces(data), mesh.faces)
assert points(data, "Normals").tobytes() == mesh.normals.tobytes()
assert data.GetPointData().GetArray("isovalue") is None
assert field(data, "name") == ["gyroid.zarr"] and field(data, "level") == [0]
assert field(data, "isovalues") == [volume.isovalue("otsu")]

surface.Normals = 0
surface.Level = 1
surface.Isovalues = "100:140:20"
several = output(surface)
meshes = [volume.extract(value, level=1) for value in (100, 120, 140)]
assert np.array_equal(vertices(several), np.concatenate([mesh.vertices for mesh in meshes]))
counts = [len(mesh.vertices) for mesh in meshes]
assert np.array_equal(points(several, "isovalue"), np.repeat([100.0, 120, 140], counts))
assert np.array_equal(faces(several)[-1], meshes[2].faces[-1] + sum(counts[:2]))
assert several.GetPointData().GetNormals() is None and field(several, "level") == [1]

surface.Isovalues = "1000"
assert output(surface).GetNumberOfCells() == 0
"""), store)
    assert errors == ""


def test_levels(script, store):
    errors = run(script("""
counts = [len(volume.extract("otsu", level=level)) for level in range(3)]
surface = IsobrickSurface(FileName=path)
for most, level in ((10**6, 0), (2 * counts[1], 1), (counts[1] // 2, 2), (5, 2)):
    surface.MaxTriangles = most
    assert field(output(surface), "level") == [level], most
surface.MaxTriangles = 10**6
surface.UpdatePipelineInformation()
assert list(surface.TimestepValues) == []
surface.CoarseToFine = 1
surface.UpdatePipelineInformation()
assert list(surface.TimestepValues) == [0, 1, 2]
for step, count in zip((0, 1, 2, 7), (counts[2], counts[1], counts[0], counts[0])):
    surface.UpdatePipeline(step)
    assert surface.GetDataInformation().GetNumberOfCells() == count, step
surface.Level = 1
surface.UpdatePipelineInformation()
assert list(surface.TimestepValues) == [0, 1]
surface.UpdatePipeline(1)
assert surface.GetDataInformation().GetNumberOfCells() == counts[1]
"""), store)
    assert errors == ""


def test_pieces_and_memory(script, store):
    errors = run(script("""
def triangles(data):
    corners = vertices(data)[faces(data)].reshape(-1, 9)
    return corners[np.lexsort(corners.T)]

surface = IsobrickSurface(FileName=path)
whole = triangles(output(surface)).copy()
algorithm = surface.GetClientSideObject()
parts = []
for piece in range(5):
    algorithm.UpdatePiece(piece, 5, 0)
    parts.append(triangles(algorithm.GetOutputDataObject(0)).copy())
assert min(map(len, parts)) > 0
parts = np.concatenate(parts)
assert np.array_equal(parts[np.lexsort(parts.T)], whole)
algorithm.UpdatePiece(99, 100, 0)
assert len(triangles(algorithm.GetOutputDataObject(0))) > 0
algorithm.UpdatePiece(0, 1000, 0)
assert algorithm.GetOutputDataObject(0).GetNumberOfCells() == 0
algorithm.UpdatePiece(0, 1, 0)

# What others hold of an output stays, whatever the source does.
kept = algorithm.GetOutputDataObject(0).NewInstance()
kept.ShallowCopy(algorithm.GetOutputDataObject(0))
before = triangles(kept).copy()
for isovalue in ("60", "90", "200"):
    surface.Isovalues = isovalue
    output(surface)
Delete(surface)
assert np.array_equal(triangles(kept), before)

seen = []
other = IsobrickSurface(FileName=path, Isovalues="100,150")
watched = other.GetClientSideObject()
watched.AddObserver("ProgressEvent", lambda caller, event: seen.append(caller.GetProgress()))
output(other)
assert seen and all(0 <= part <= 1 for part in seen) and max(seen) == 1
watched.AddObserver("ProgressEvent", lambda caller, event: caller.SetAbortExecute(1))
other.Isovalues = "101"
assert output(other).GetNumberOfCells() == 0
"""), store)
    assert errors == ""


def test_regions_and_samples(script, tmp_path):
    path = tmp_path / "ball.zarr"
    isobrick.convert(ball(), path, spacing=(0.5, 0.75, 2), origin=(10, -20, 30), unit="mm", brick=16)
    errors = run(script("""
surface = IsobrickSurface(FileName=path, Isovalues="1", Region=[12.1, 30.2, 0, 0, 50, 70])
data = output(surface)
mesh = volume.extract(1, roi=np.s_[10:21, :, 4:42], normals=True)
assert vertices(data).tobytes() == mesh.vertices.tobytes() and len(mesh) > 100
assert field(data, "unit") == ["millimeter"]

samples = IsobrickVolume(FileName=path)
image = output(samples)
assert image.GetExtent() == (0, 59, 0, 49, 0, 39)
assert image.GetSpacing() == (0.5, 0.75, 2) and image.GetOrigin() == (10, -20, 30)
assert points(image, "samples").tobytes() == volume.read().tobytes()
assert field(image, "unit") == ["millimeter"] and field(image, "level") == [0]
samples.Memory = "16k"
assert field(output(samples), "level") == [3]
samples.Memory = "100k"
assert field(output(samples), "level") == [2]
samples.Region = [12.1, 13.9, 0, 0, 50, 70]
image = output(samples)
assert field(image, "level") == [0] and image.GetExtent() == (4, 8, 0, 49, 10, 20)
assert points(image, "samples").tobytes() == volume.read(0, np.s_[10:21, :, 4:9]).tobytes()

# Only what a filter requests is read.
fresh = IsobrickVolume(FileName=path)
part = ExtractSubset(Input=fresh, VOI=[3, 20, 4, 5, 6, 17])
image = output(part)
assert fresh.GetClientSideObject().GetOutputDataObject(0).GetExtent() == (3, 20, 4, 5, 6, 17)
assert points(image, "samples").tobytes() == volume.read(0, np.s_[6:18, 4:6, 3:21]).tobytes()
"""), path)
    assert errors == ""


def test_turned_volumes(script, tmp_path):
    path = tmp_path / "turned.zarr"
    turn = ((0, -1, 0), (1, 0, 0), (0, 0, 1))  # x to y, y to -x
    isobrick.convert(ball(), path, direction=turn, spacing=(0.5, 0.75, 2), origin=(10, -20, 30),
                     brick=16)
    errors = run(script("""
turn = volume.direction
box = [-10.1, 0, -18.9, -5.2, 0, 0]
image = output(IsobrickVolume(FileName=path, Region=box))
assert image.GetExtent() == (2, 30, 13, 27, 0, 39)
matrix = image.GetDirectionMatrix()
assert [[matrix.GetElement(i, j) for j in range(3)] for i in range(3)] == turn.tolist()
for index, expected in (([2, 13, 0], [0.25, -19, 30]), ([30, 27, 39], [-10.25, -5, 108])):
    place = [0.0, 0.0, 0.0]
    image.TransformIndexToPhysicalPoint(index, place)
    assert place == expected
data = output(IsobrickSurface(FileName=path, Isovalues="1", Region=box))
mesh = volume.extract(1, roi=np.s_[:, 13:28, 2:31], normals=True)
assert vertices(data).tobytes() == mesh.vertices.tobytes() and len(mesh) > 100
"""), path)
    assert errors == ""


def test_opening(script, store, tmp_path):
    field = tmp_path / "a.nrrd"
    isobrick.export(store, field)
    errors = run(script("""
assert type(OpenDataFile(path)).__name__ == "IsobrickSurface"
surface = IsobrickSurface(FileName=sys.argv[2])
assert output(surface).GetNumberOfCells() == len(volume.extract("otsu"))
surface.FileName = path
assert field(output(surface), "name") == ["gyroid.zarr"]
"""), store, field)
    assert errors == ""


def test_channels_and_times(script, image):
    path, samples = image
    np.save(path.parent / "samples.npy", samples)
    errors = run(script("""
samples = np.load(sys.argv[2])
for time, channel in ((0, 1), (2, 0)):
    request = dict(FileName=path, Channel=channel, Time=time)
    data = output(IsobrickVolume(**request))
    assert points(data, "samples").tobytes() == samples[time, channel].tobytes()
    assert data.GetSpacing() == (0.5, 0.5, 2) and field(data, "unit") == ["micrometer"]
    mesh = isobrick.extract(samples[time, channel], 200, spacing=(0.5, 0.5, 2))
    data = output(IsobrickSurface(Isovalues="200", Normals=0, **request))
    assert vertices(data).tobytes() == mesh.vertices.tobytes() and len(mesh) > 100
"""), path, path.parent / "samples.npy")
    assert errors == ""


def test_the_examples_of_the_guide_run(tmp_path):
    page = (ROOT / "docs/guide/paraview.md").read_text()
    blocks = [block.split("```")[0] for block in page.split("```python\n")[1:]]
    assert len(blocks) >= 3
    isobrick.synth("gyroid", tmp_path / "gyroid.zarr", shape=(60, 50, 40), dtype="uint8", brick=16)
    script = tmp_path / "example.py"
    script.write_text("\n".join(blocks) + "\nprint('done')\n")
    errors = run(script, display=True, cwd=tmp_path,
                 env={**os.environ, "PV_PLUGIN_PATH": str(PLUGIN.parent)})
    assert errors == ""
    for step in range(3):
        assert (tmp_path / f"step{step}.png").stat().st_size > 1000


def test_errors_are_one_line(script, store):
    errors = run(script("""
for request in (dict(FileName="/none.zarr"), dict(FileName=path, Isovalues="nothing"),
                dict(FileName=path, Level=9), dict(FileName=path, Region=[5, 1, 0, 0, 0, 0]),
                dict(FileName=path, Region=[500, 501, 0, 0, 0, 0]),
                dict(FileName=path, Memory="much")):
    assert output(IsobrickSurface(**request)).GetNumberOfCells() == 0
output(IsobrickSurface())
surface = IsobrickSurface(FileName=path, Level=9)
output(surface)
surface.Level = 0
assert output(surface).GetNumberOfCells() > 0
assert output(IsobrickVolume(FileName=path, Level=9)).GetNumberOfPoints() == 0
"""), store)
    lines = [line for line in errors.splitlines() if line.strip("\x1b[0m ")]
    assert len(lines) == 8 and all("Isobrick: " in line for line in lines), errors
    for line, part in zip(lines, ("/none.zarr: No such file", "'nothing' is no isovalue",
                                  "there is no level 9", "is empty", "does not touch", "'much'")):
        assert part in line


@pytest.mark.parametrize("program", ["pvpython", "pvbatch"])
def test_a_picture(script, store, tmp_path, program):
    image = pytest.importorskip("PIL.Image")
    picture = tmp_path / "a.png"
    run(script("""
view = CreateView("RenderView", ViewSize=[300, 200], Background=[0, 0, 0])
view.UseColorPaletteForBackground = 0
view.OrientationAxesVisibility = 0
display = Show(IsobrickSurface(FileName=path, Isovalues="110,150"), view)
ColorBy(display, ("POINTS", "isovalue"))
ResetCamera(view)
SaveScreenshot(sys.argv[2], view, ImageResolution=[300, 200])
"""), store, picture, program=program, display=True)
    pixels = np.asarray(image.open(picture).convert("RGB")).astype(int)
    drawn = pixels.max(axis=2) > 20
    assert 0.1 < drawn.mean() < 0.9 and not drawn[0].any() and not drawn[-1].any()
    assert (pixels[..., 0] > pixels[..., 2] + 30).any() and (pixels[..., 2] > pixels[..., 0] + 30).any()
