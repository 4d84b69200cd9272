#!/usr/bin/env python3
"""Times `isobrick convert` of each volume format beside the library of that format.

The samples of a raw volume are repeated to fill a cube of u16, written in each format
by its Python library, and then, in turn, so that whatever else the machine does meets
all alike: the library reads the file, isobrick converts the raw file, isobrick converts
the file. The last should take at most 1.3 times the slower of the first two. Wall
and processor seconds, medians; on a busy machine the latter are more reliable.

    bench/format_bench.py build/release/bin/isobrick bonsai_256x256x256_uint8.raw

Of Zarr it is timed, too, how long `isobrick index` takes in place, which reads all and writes
ranges and a search structure only.

Needs Debian's numpy, and of nibabel, vtkmodules, tifffile, h5py, pydicom, zarr what is to be
compared.
"""

import argparse
import gzip
import os
import pathlib
import re
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time

import numpy


def nrrd(path, samples):
    header = "NRRD0004\ntype: ushort\ndimension: 3\nsizes: {} {} {}\nendian: little\nencoding: gzip\n\n"
    path.write_bytes(header.format(*samples.shape[::-1]).encode() + gzip.compress(samples.tobytes(), 6))


def nifti(path, samples):
    import nibabel
    nibabel.save(nibabel.Nifti1Image(samples.T, numpy.eye(4)), path)


def vti(path, samples, how=("SetCompressorTypeToZLib",)):
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonDataModel import vtkImageData
    from vtkmodules.vtkIOXML import vtkXMLImageDataWriter
    image = vtkImageData()
    image.SetDimensions(*samples.shape[::-1])
    array = numpy_to_vtk(samples.ravel())
    array.SetName("v")
    image.GetPointData().SetScalars(array)
    writer = vtkXMLImageDataWriter()
    writer.SetFileName(str(path))
    writer.SetInputData(image)
    for call in how:
        getattr(writer, call)()
    writer.Write()


def vti_base64(path, samples):
    vti(path, samples, ("SetCompressorTypeToNone", "EncodeAppendedDataOn"))


def tiff(path, samples):
    import tifffile
    tifffile.imwrite(path, samples, photometric="minisblack", compression="zlib", metadata=None)


def tiff_plain(path, samples):
    import tifffile
    tifffile.imwrite(path, samples, photometric="minisblack", metadata=None)


def hdf5(path, samples):
    import h5py
    with h5py.File(path, "w") as file:
        file.create_dataset("v", data=samples, chunks=(64, 64, 64), compression="gzip")


def dicom(path, samples):
    import pydicom
    from pydicom.dataset import FileDataset, FileMetaDataset
    path.mkdir()
    for z, plane in enumerate(samples):
        meta = FileMetaDataset()
        meta.MediaStorageSOPClassUID = pydicom.uid.CTImageStorage
        meta.MediaStorageSOPInstanceUID = pydicom.uid.generate_uid()
        meta.TransferSyntaxUID = pydicom.uid.ExplicitVRLittleEndian
        data = FileDataset(None, {}, file_meta=meta, preamble=b"\0" * 128)
        data.SOPClassUID = meta.MediaStorageSOPClassUID
        data.SOPInstanceUID, data.SeriesInstanceUID = meta.MediaStorageSOPInstanceUID, "1.2.3"
        data.Rows, data.Columns = plane.shape
        data.SamplesPerPixel, data.PhotometricInterpretation = 1, "MONOCHROME2"
        data.BitsAllocated, data.BitsStored, data.HighBit = 16, 16, 15
        data.PixelRepresentation, data.PixelSpacing = 0, [1, 1]
        data.ImageOrientationPatient, data.ImagePositionPatient = [1, 0, 0, 0, 1, 0], [0, 0, z]
        data.PixelData = plane.tobytes()
        data.is_little_endian, data.is_implicit_VR = True, False
        data.save_as(path / f"{z}.dcm", write_like_original=False)


def zarr_v2(path, samples, codec):
    import zarr
    array = zarr.open_array(str(path), mode="w", shape=samples.shape, chunks=(64, 64, 64), dtype="<u2",
                            compressor=codec, zarr_version=2)
    array[:] = samples


def zarr_blosc(path, samples):
    import numcodecs
    zarr_v2(path, samples, numcodecs.Blosc())  # zarr-python's own choice: LZ4, shuffled


def zarr_gzip(path, samples):
    import numcodecs
    zarr_v2(path, samples, numcodecs.GZip(6))


def zarr_v3(path, samples):
    """Chunks of 64³ by zstd. Debian's zarr-python knows no version 3 as it was published, so that
    its numcodecs encodes and the array's metadata is written here."""
    import itertools
    import json
    import numcodecs
    path.mkdir()
    (path / "zarr.json").write_text(json.dumps({
        "zarr_format": 3, "node_type": "array", "shape": samples.shape, "data_type": "uint16",
        "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": [64, 64, 64]}},
        "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}},
        "codecs": [{"name": "bytes", "configuration": {"endian": "little"}},
                   {"name": "zstd", "configuration": {"level": 3, "checksum": False}}],
        "fill_value": 0, "attributes": {}}))
    codec = numcodecs.Zstd(3)
    for at in itertools.product(*(range(-(-size // 64)) for size in samples.shape)):
        part = samples[tuple(slice(64 * i, 64 * i + 64) for i in at)]
        chunk = numpy.zeros((64, 64, 64), "<u2")
        chunk[tuple(map(slice, part.shape))] = part
        name = path.joinpath("c", *map(str, at))
        name.parent.mkdir(parents=True, exist_ok=True)
        name.write_bytes(codec.encode(chunk))


READERS = {
    "nrrd": "import gzip, numpy; f = open(path, 'rb').read(); "
            "numpy.frombuffer(gzip.decompress(f[f.index(b'\\n\\n') + 2:]), 'u2')",
    "nifti": "import nibabel, numpy; numpy.asanyarray(nibabel.load(path).dataobj)",
    "vti": "from vtkmodules.vtkIOXML import vtkXMLImageDataReader as R; r = R(); "
           "r.SetFileName(path); r.Update()",
    "tiff": "import tifffile; tifffile.imread(path)",
    "hdf5": "import h5py; h5py.File(path)['v'][:]",
    "dicom": "import pathlib, pydicom; "
             "[pydicom.dcmread(p).pixel_array.copy() for p in pathlib.Path(path).iterdir()]",
    "zarr": "import zarr; zarr.open_array(path, mode='r')[:]",
    "chunks": "import pathlib, numcodecs; codec = numcodecs.Zstd(); "
              "[codec.decode(p.read_bytes()) for p in pathlib.Path(path, 'c').glob('*/*/*')]",
}
CASES = {
    "nrrd gzip": (nrrd, "v.nrrd", "nrrd"), "nifti gzip": (nifti, "v.nii.gz", "nifti"),
    "nifti": (nifti, "v.nii", "nifti"), "vti zlib": (vti, "v.vti", "vti"),
    "vti base64": (vti_base64, "b.vti", "vti"), "tiff zlib": (tiff, "z.tif", "tiff"),
    "tiff": (tiff_plain, "v.tif", "tiff"), "hdf5 gzip": (hdf5, "v.h5", "hdf5"),
    "dicom": (dicom, "series", "dicom"), "zarr2 blosc": (zarr_blosc, "b.zarr", "zarr"),
    "zarr2 gzip": (zarr_gzip, "g.zarr", "zarr"), "zarr3 zstd": (zarr_v3, "z.zarr", "chunks"),
}


def read_by_library(kind, path):
    """Wall and processor seconds of reading, without the start of Python and its imports."""
    imports = READERS[kind].split(";", maxsplit=1)[0]
    program = (f"import time; {imports}; path = {str(path)!r}\n"
               f"start = time.monotonic(), time.process_time()\n{READERS[kind]}\n"
               f"print(time.monotonic() - start[0], time.process_time() - start[1])")
    done = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True,
                          encoding="utf-8")
    return [float(number) for number in done.stdout.split()]


def run(words):
    """Wall and processor seconds of a program."""
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    subprocess.run(words, check=True)
    wall, after = time.monotonic() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def convert(program, path, store):
    shutil.rmtree(store, ignore_errors=True)
    return run([program, "convert", path, store, "--quiet"])


def index_in_place(program, path):
    shutil.rmtree(path / "isobrick", ignore_errors=True)
    return run([program, "index", path, "--kind", "octree", "--quiet"])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("isobrick")
    parser.add_argument("raw", help="a volume of u8 with its extent in its name")
    parser.add_argument("--edge", type=int, default=512, help="samples along each edge of the cube")
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--only", nargs="*", default=list(CASES))
    parser.add_argument("--folder", help="where to write")
    arguments = parser.parse_args()
    extent = [int(n) for n in re.search(r"(\d+)x(\d+)x(\d+)", arguments.raw).groups()]
    samples = numpy.fromfile(arguments.raw, "u1").reshape(extent[::-1])
    edge = arguments.edge
    samples = numpy.tile(samples, [-(-edge // size) for size in samples.shape])[:edge, :edge, :edge]
    samples = samples.astype("u2") * 257
    print(f"{edge}³ samples of u16, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    with tempfile.TemporaryDirectory(dir=arguments.folder) as folder:
        folder = pathlib.Path(folder)
        raw, store = folder / f"raw_{edge}x{edge}x{edge}_uint16.raw", folder / "out.zarr"
        samples.tofile(raw)
        for name in arguments.only:
            write, file, kind = CASES[name]
            write(folder / file, samples)
            runs = [(read_by_library(kind, folder / file), convert(arguments.isobrick, raw, store),
                     convert(arguments.isobrick, folder / file, store))
                    for _ in range(arguments.repeat)]
            for i, clock in enumerate(("wall", "cpu")):
                library, plain, ours = (statistics.median(run[i] for run in runs_of_one)
                                        for runs_of_one in zip(*runs))
                print(f"  {name if i == 0 else '':11} {clock:4} library {library:7.3f} s   "
                      f"raw {plain:7.3f} s   convert {ours:7.3f} s   "
                      f"{ours / max(library, plain):5.2f} of the slower", flush=True)
            if file.endswith(".zarr"):
                runs = [index_in_place(arguments.isobrick, folder / file)
                        for _ in range(arguments.repeat)]
                wall, cpu = (statistics.median(clock) for clock in zip(*runs))
                print(f"              index in place: wall {wall:.3f} s, cpu {cpu:.3f} s", flush=True)


if __name__ == "__main__":
    main()
