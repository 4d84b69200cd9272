"""DICOM series beside pydicom: a real one, and what pydicom writes."""

import itertools
import random
import sys
import tarfile

from volume_check import main, numpy, pattern

try:
    import pydicom
    from pydicom.dataset import FileDataset, FileMetaDataset
    from pydicom.uid import (ExplicitVRBigEndian, ExplicitVRLittleEndian, ImplicitVRLittleEndian,
                             RLELossless)
except ImportError as error:
    print(f"skipped: {error}")
    sys.exit(77)


def integer_type(data, stored, scales):
    """The smallest type that holds all values of the bits in use."""
    bits, signed = data.BitsStored, data.PixelRepresentation == 1
    ends = (-2 ** (bits - 1), 2 ** (bits - 1) - 1) if signed else (0, 2 ** bits - 1)
    real = [end * slope + inter for end in ends for slope, inter in scales]
    for name in (stored.str[1:], "u1", "i1", "u2", "i2", "u4", "i4"):
        limits = numpy.iinfo(name)
        if limits.dtype.itemsize >= stored.itemsize and limits.min <= min(real) <= max(real) <= limits.max:
            return name
    return "f4"


def read(folder):
    """Samples and matrix of a series, by pydicom alone."""
    slices = [pydicom.dcmread(path) for path in folder.iterdir()]
    row, column = numpy.array(slices[0].ImageOrientationPatient, float).reshape(2, 3)
    normal = numpy.cross(row, column)
    slices.sort(key=lambda s: numpy.dot(normal, numpy.array(s.ImagePositionPatient, float)))
    first, last = (numpy.array(s.ImagePositionPatient, float) for s in (slices[0], slices[-1]))
    affine = numpy.eye(4)
    spacing = [float(number) for number in slices[0].PixelSpacing]
    affine[:3, :3] = numpy.array([row * spacing[1], column * spacing[0],
                                  (last - first) / (len(slices) - 1)]).T
    affine[:3, 3] = first
    scales = [(float(s.get("RescaleSlope", 1)), float(s.get("RescaleIntercept", 0))) for s in slices]
    samples = numpy.stack([s.pixel_array for s in slices])
    if any(scale != (1, 0) for scale in scales):
        stored = samples.dtype
        samples = numpy.stack([plane * slope + inter for plane, (slope, inter)
                               in zip(samples.astype("f8"), scales)])
        whole = all(slope % 1 == 0 and inter % 1 == 0 for slope, inter in scales)
        samples = samples.astype(integer_type(slices[0], stored, scales) if whole else "f4")
    return samples, affine


def write(folder, samples, syntax, scale=None, bits=None, edit=None):
    """A series with a turned orientation, its files named in any order."""
    folder.mkdir(exist_ok=True)
    for path in folder.iterdir():
        path.unlink()
    c, s = numpy.cos(0.3), numpy.sin(0.3)
    row, column = numpy.array([c, s, 0]), numpy.array([-s * c, c * c, s])
    series = pydicom.uid.generate_uid()
    names = random.Random(1).sample(range(1000), len(samples))
    for z, plane in enumerate(samples):
        meta = FileMetaDataset()
        meta.MediaStorageSOPClassUID = pydicom.uid.CTImageStorage
        meta.MediaStorageSOPInstanceUID = pydicom.uid.generate_uid()
        meta.TransferSyntaxUID = ExplicitVRLittleEndian if syntax == RLELossless else syntax
        data = FileDataset(None, {}, file_meta=meta, preamble=b"\0" * 128)
        data.SOPClassUID, data.SOPInstanceUID = (meta.MediaStorageSOPClassUID,
                                                 meta.MediaStorageSOPInstanceUID)
        data.SeriesInstanceUID, data.InstanceNumber, data.Modality = series, z, "CT"
        data.Rows, data.Columns = plane.shape
        data.SamplesPerPixel, data.PhotometricInterpretation = 1, "MONOCHROME2"
        data.BitsAllocated = 8 * plane.dtype.itemsize
        data.BitsStored = bits or data.BitsAllocated
        data.HighBit = data.BitsStored - 1
        data.PixelRepresentation = int(plane.dtype.kind == "i")
        data.PixelSpacing, data.SliceThickness = [1.25, 0.5], 9
        data.ImageOrientationPatient = [f"{number:.6f}" for number in (*row, *column)]
        data.ImagePositionPatient = [f"{number:.6f}" for number in
                                     [-10, 20.5, 7] + numpy.cross(row, column) * 3 * z]
        if scale:
            data.RescaleSlope, data.RescaleIntercept = scale(z)
        data.is_little_endian = syntax != ExplicitVRBigEndian
        data.is_implicit_VR = syntax == ImplicitVRLittleEndian
        order = "<" if data.is_little_endian else ">"
        data.PixelData = plane.astype(plane.dtype.newbyteorder(order)).tobytes()
        data.PixelData += b"\0" * (len(data.PixelData) % 2)
        data["PixelData"].VR = "OB" if plane.dtype.itemsize == 1 and not data.is_implicit_VR else "OW"
        if edit:
            edit(z, data)
        if syntax == RLELossless:
            data.compress(RLELossless)
        data.save_as(folder / f"{names[z]}.dcm", write_like_original=False)


def check_series(state):
    folder = state.folder / "series"
    for kind, syntax in itertools.product(("u1", "i1", "u2", "i2"),
                                          (ImplicitVRLittleEndian, ExplicitVRLittleEndian,
                                           ExplicitVRBigEndian, RLELossless)):
        if kind in ("u1", "i1") and syntax == ExplicitVRBigEndian:
            continue  # bytes of OW change places; nobody writes such files
        write(folder, pattern((7, 9, 12), kind), syntax)
        state.same(f"{kind} {syntax.name}", folder, *read(folder))
    for name, scale in (("same", lambda z: (2.5, -1000)), ("each its own", lambda z: (z + 1, 0.5))):
        write(folder, pattern((7, 9, 12), "i2"), ExplicitVRLittleEndian, scale)
        samples, affine = read(folder)
        state.same(f"scale {name}", folder, samples, affine, exact=False)
    write(folder, pattern((7, 9, 12), "i2") >> 4, ExplicitVRLittleEndian, bits=12)
    state.same("12 bits", folder, *read(folder))


def check_refused(state):
    folder = state.folder / "series"
    samples = pattern((7, 9, 12), "i2")

    def refused(name, edit, *parts, options=()):
        write(folder, samples, ExplicitVRLittleEndian, edit=edit)
        state.refused(name, folder, *parts, options=options)

    def set_at(place, **attributes):
        def edit(z, data):
            if z == place:
                for name, value in attributes.items():
                    setattr(data, name, value)
        return edit

    refused("two series", set_at(3, SeriesInstanceUID="1.2.3"), "2 DICOM series", "1.2.3")
    refused("another size", set_at(3, Rows=6, Columns=18), "another extent")
    refused("another orientation", set_at(3, ImageOrientationPatient=[1, 0, 0, 0, 1, 0]),
            "orientation")
    refused("another spacing", set_at(3, PixelSpacing=[1, 1]), "spacing")
    refused("colours", lambda z, data: setattr(data, "SamplesPerPixel", 3), "3 samples")
    refused("short", set_at(3, PixelData=b"1234"), ".dcm")
    refused("channel", None, "1 channel", options=("--channel", 1))
    write(folder, samples, ExplicitVRLittleEndian)
    next(path for path in folder.iterdir()
         if pydicom.dcmread(path).InstanceNumber == 3).unlink()
    state.refused("a gap", folder, "a slice is missing")
    for name, text in (("broken", b"\0" * 128 + b"DICM" + b"x" * 300),):
        write(folder, samples, ExplicitVRLittleEndian)
        (folder / f"{name}.dcm").write_bytes(text)
        state.refused(name, folder, f"{name}.dcm")

    def twice(z, data):
        data.ImagePositionPatient = [0, 0, z // 2]
        data.ImageOrientationPatient = [1, 0, 0, 0, 1, 0]
    write(folder, pattern((8, 9, 12), "i2"), ExplicitVRLittleEndian, edit=twice)
    state.refused("times", folder, "2 times", "--time")
    for t in range(2):
        state.same(f"time {t}", folder, pattern((8, 9, 12), "i2")[t::2], options=("--time", t))


def check(state):
    archive = state.originals / "pet_wb_dicom.tar"
    if archive.exists():
        with tarfile.open(archive) as tar:
            tar.extractall(state.folder)
        samples, affine = read(state.folder / "pet_wb")
        state.same("pet_wb", state.folder / "pet_wb", samples, affine)
    check_series(state)
    check_refused(state)


if __name__ == "__main__":
    sys.exit(main(check))
