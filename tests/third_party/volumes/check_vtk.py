"""VTK files beside VTK's own readers: real ones, and what its writers write."""

import itertools
import sys

from volume_check import main, numpy, pattern

try:
    from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
    from vtkmodules.vtkCommonDataModel import vtkImageData
    from vtkmodules.vtkIOLegacy import vtkDataSetReader, vtkDataSetWriter
    from vtkmodules.vtkIOXML import vtkXMLImageDataReader, vtkXMLImageDataWriter
except ImportError as error:
    print(f"skipped: {error}")
    sys.exit(77)


def affine_of(image):
    """From indices counted from the first sample to world."""
    matrix = numpy.eye(4)
    direction = numpy.array([[image.GetDirectionMatrix().GetElement(i, j) for j in range(3)]
                             for i in range(3)])
    matrix[:3, :3] = direction * image.GetSpacing()
    matrix[:3, 3] = image.GetOrigin() + matrix[:3, :3] @ numpy.array(image.GetExtent()[::2])
    return matrix


def read(path):
    reader = vtkXMLImageDataReader() if path.suffix == ".vti" else vtkDataSetReader()
    reader.SetFileName(str(path))
    reader.Update()
    image = reader.GetOutput()
    samples = vtk_to_numpy(image.GetPointData().GetScalars())
    return samples.reshape(image.GetDimensions()[::-1] + samples.shape[1:]), affine_of(image)


def make(samples, name="density"):
    image = vtkImageData()
    image.SetExtent(3, 3 + samples.shape[2] - 1, 0, samples.shape[1] - 1, -2, samples.shape[0] - 3)
    image.SetSpacing(0.5, 1.25, 3)
    image.SetOrigin(-10, 20.5, 7)
    array = numpy_to_vtk(samples.reshape((-1,) + samples.shape[3:]), deep=True)
    array.SetName(name)
    image.GetPointData().SetScalars(array)
    return image


def write(image, path, **how):
    writer = vtkXMLImageDataWriter() if path.suffix == ".vti" else vtkDataSetWriter()
    writer.SetFileName(str(path))
    writer.SetInputData(image)
    for name, value in how.items():
        getattr(writer, name)(*value)
    writer.Write()


def check_xml(state):
    kinds = ["u1", "i1", "i2", "u2", "i4", "u4", "i8", "u8", "f4", "f8"]
    modes = {"raw": dict(SetDataModeToAppended=(), EncodeAppendedDataOff=()),
             "base64": dict(SetDataModeToAppended=(), EncodeAppendedDataOn=()),
             "inline": dict(SetDataModeToBinary=()), "ascii": dict(SetDataModeToAscii=())}
    c, s = numpy.cos(0.3), numpy.sin(0.3)
    for kind, (mode, how), packed, big in itertools.product(kinds, modes.items(), (True, False),
                                                            (True, False)):
        image = make(pattern((9, 8, 70), kind))
        image.SetDirectionMatrix(c, -s, 0, s, c, 0, 0, 0, -1)
        name = f"{kind}_{mode}_{'zlib' if packed else 'plain'}_{'be' if big else 'le'}.vti"
        how = dict(how, SetBlockSize=(4096,))
        how["SetCompressorTypeToZLib" if packed else "SetCompressorTypeToNone"] = ()
        how["SetByteOrderToBigEndian" if big else "SetByteOrderToLittleEndian"] = ()
        how["SetHeaderTypeToUInt64" if big else "SetHeaderTypeToUInt32"] = ()
        write(image, state.folder / name, **how)
        # VTK's own reader and writer disagree on big-endian text; the samples are known.
        state.same(name, state.folder / name, pattern((9, 8, 70), kind), affine_of(image),
                   exact=mode != "ascii")
    image = make(pattern((3, 4, 5, 2), "i2"))
    other = numpy_to_vtk(pattern((3, 4, 5), "f4").ravel(), deep=True)
    other.SetName("other")
    image.GetPointData().AddArray(other)
    write(image, state.folder / "two.vti")
    state.refused("components", state.folder / "two.vti", "2 channels", "--channel")
    state.same("channel", state.folder / "two.vti", pattern((3, 4, 5, 2), "i2")[..., 1],
               options=("--channel", 1))
    state.same("named", f"{state.folder / 'two.vti'}:/other", pattern((3, 4, 5), "f4"))
    image.GetPointData().SetActiveScalars(None)
    write(image, state.folder / "two.vti")
    state.refused("ambiguous", state.folder / "two.vti", "density", "other")
    for compressor in ("LZ4", "LZMA"):
        write(image, state.folder / "other.vti", **{f"SetCompressorTypeTo{compressor}": ()})
        state.refused(compressor, f"{state.folder / 'other.vti'}:/other", compressor)


def check_legacy(state):
    for kind, text in itertools.product(["u1", "i2", "u2", "i4", "u4", "i8", "u8", "f4", "f8"], (True, False)):
        image = make(pattern((9, 8, 7), kind))
        image.SetExtent(0, 6, 0, 7, 0, 8)
        name = f"{kind}_{'ascii' if text else 'binary'}.vtk"
        write(image, state.folder / name,
              **{"SetFileTypeToASCII" if text else "SetFileTypeToBinary": ()})
        samples, affine = read(state.folder / name)
        state.same(name, state.folder / name, samples, affine, exact=not text)
    image = make(pattern((3, 4, 5, 3), "u1"))
    image.SetExtent(0, 4, 0, 3, 0, 2)
    write(image, state.folder / "rgb.vtk", SetFileTypeToBinary=())
    state.refused("vtk colours", state.folder / "rgb.vtk", "3 channels")
    state.same("vtk colour", state.folder / "rgb.vtk", pattern((3, 4, 5, 3), "u1")[..., 2],
               options=("--channel", 2))


def check(state):
    for path in sorted(state.originals.glob("*.vt[ik]")):
        samples, affine = read(path)
        state.same(path.name, path, samples, affine)
    check_xml(state)
    check_legacy(state)


if __name__ == "__main__":
    sys.exit(main(check))
