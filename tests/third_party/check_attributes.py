"""Compares vertex attributes with samples of VTK's probe, and reads them back with other readers.

  python3 check_attributes.py ISOBRICK

Exit status: 0 equal, 1 different, 77 VTK is not installed.
"""

import pathlib
import subprocess
import sys
import tempfile

try:
    import numpy
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy
except ImportError as error:
    print(f"skipped: {error}")
    sys.exit(77)

try:
    import meshio
except ImportError:
    meshio = None

ISOBRICK = sys.argv[1]
EXTENT = (48, 40, 37)  # x, y, z
# Spacing and origin as text, so that both programs have the same numbers.
CASES = {
    "uint8": ("1,1,1", "0,0,0"),
    "int16": ("0.5,1.25,1.5", "3,-2,1"),
    "float32": ("0.75,0.8,1.3", "5,4,-3"),
    "float64": ("2,0.9,1", "-9,1,0"),
}
failures = []


def check(condition, what):
    if not condition:
        failures.append(what)
        print(f"wrong: {what}")


def run(*words):
    subprocess.run([ISOBRICK, *map(str, words)], check=True, stdout=subprocess.DEVNULL)


def numbers(text):
    return [float(word) for word in text.split(",")]


def probed(points, samples, spacing, origin):
    """VTK's samples at the points, and where they are valid."""
    image = vtk.vtkImageData()
    image.SetDimensions(EXTENT)
    image.SetSpacing(spacing)
    image.SetOrigin(origin)
    # Interpolated in double precision whatever the type.
    array = numpy_to_vtk(samples.astype(numpy.float64).ravel(), deep=True)
    array.SetName("p")
    image.GetPointData().SetScalars(array)
    cloud = vtk.vtkPoints()
    cloud.SetDataTypeToDouble()
    cloud.SetData(numpy_to_vtk(points.astype(numpy.float64), deep=True))
    data = vtk.vtkPolyData()
    data.SetPoints(cloud)
    probe = vtk.vtkProbeFilter()
    probe.SetInputData(data)
    probe.SetSourceData(image)
    probe.Update()
    result = probe.GetOutput().GetPointData()
    valid = vtk_to_numpy(result.GetArray(probe.GetValidPointMaskArrayName())) != 0
    return vtk_to_numpy(result.GetArray("p")), valid


def read(path, reader):
    reader.SetFileName(str(path))
    reader.Update()
    data = reader.GetOutput()
    return (
        vtk_to_numpy(data.GetPoints().GetData()),
        vtk_to_numpy(data.GetPointData().GetArray("p")),
    )


def check_case(folder, kind, spacing, origin):
    rng = numpy.random.default_rng(1)
    low, high = (0, 255) if kind == "uint8" else (-900, 900)
    samples = rng.uniform(low, high, EXTENT[::-1]).astype(kind)
    raw, store = folder / f"{kind}.raw", folder / f"{kind}.zarr"
    samples.tofile(raw)
    short = {"uint8": "u8", "int16": "i16", "float32": "f32", "float64": "f64"}[kind]
    run("convert", raw, store, "--dims", ",".join(map(str, EXTENT)), "--type", short,
        f"--spacing={spacing}", f"--origin={origin}", "--brick", 16, "--shard", 32)
    mesh = folder / f"{kind}.vtp"
    run("extract", folder / "ball.zarr", "--isovalue", "0", "-o", mesh, "--attribute", f"p={store}")
    points, values = read(mesh, vtk.vtkXMLPolyDataReader())
    expected, valid = probed(points, samples, numbers(spacing), numbers(origin))
    check(valid.sum() > 500, f"{kind}: only {valid.sum()} points are inside")
    error = numpy.abs(values[valid] - expected[valid]).max()
    # float32 of the values, and of positions that VTK and we divide differently.
    check(error < 1e-4 * (high - low), f"{kind}: {error} from VTK")
    check((numpy.isnan(values) == ~valid).mean() > 0.999, f"{kind}: NaN elsewhere than VTK")
    print(f"{kind}: {valid.sum()} of {len(values)} points, largest difference {error:.3g}")
    return mesh, points, values


def check_readers(folder, points, values):
    store = folder / "float32.zarr"
    words = ("extract", folder / "ball.zarr", "--isovalue", "0", "--attribute", f"p={store}", "-o")
    ply, pvtp = folder / "m.ply", folder / "m.pvtp"
    run(*words, ply)
    run(*words, pvtp)
    in_parts = read(pvtp, vtk.vtkXMLPPolyDataReader())
    check(numpy.array_equal(in_parts[1], values, equal_nan=True), "PVTP has other values")
    reader = vtk.vtkPLYReader()  # passes over properties that it does not know
    reader.SetFileName(str(ply))
    reader.Update()
    cloud = vtk_to_numpy(reader.GetOutput().GetPoints().GetData())
    check(numpy.array_equal(cloud, points), "vtkPLYReader has other points")
    if meshio:
        mesh = meshio.read(ply)
        check(numpy.array_equal(mesh.points.astype(numpy.float32), points), "meshio: points")
        check(numpy.array_equal(mesh.point_data["p"], values, equal_nan=True), "meshio: values")


with tempfile.TemporaryDirectory() as name:
    folder = pathlib.Path(name)
    # A ball that leaves the smaller volumes.
    z, y, x = numpy.mgrid[0:44, 0:44, 0:44].astype(numpy.float32)
    (18.3 - numpy.sqrt((x - 21) ** 2 + (y - 20) ** 2 + (z - 22) ** 2)).astype("f4").tofile(
        folder / "ball.raw")
    run("convert", folder / "ball.raw", folder / "ball.zarr", "--dims", "44,44,44", "--type", "f32")
    for kind, (spacing, origin) in CASES.items():
        made = check_case(folder, kind, spacing, origin)
        if kind == "float32":
            check_readers(folder, *made[1:])
sys.exit(1 if failures else 0)
