"""NIfTI files beside nibabel: real ones, and all types, orders and transforms."""

import itertools
import sys

from volume_check import main, numpy, pattern

try:
    import nibabel
except ImportError as error:
    print(f"skipped: {error}")
    sys.exit(77)


def expected(image, *index):
    """What nibabel reads, [z, y, x]: stored values, or f32 where they are scaled."""
    slope, inter = image.dataobj.slope, image.dataobj.inter
    stored = numpy.asanyarray(image.dataobj.get_unscaled())
    if (slope, inter) != (1, 0):
        stored = (stored.astype("f8") * slope + inter).astype("f8" if stored.dtype.itemsize == 8
                                                              else "f4")
    return stored[(...,) + index].T


def turned():
    """An affine with a rotation, a mirrored axis and three spacings."""
    c, s = numpy.cos(0.3), numpy.sin(0.3)
    rotation = numpy.array([[c, -s, 0], [s, c, 0], [0, 0, -1]]) @ numpy.array(
        [[1, 0, 0], [0, c, -s], [0, s, c]])
    affine = numpy.eye(4)
    affine[:3, :3] = rotation * [0.5, 1.25, 3]
    affine[:3, 3] = [-10, 20.5, 7]
    return affine


def check(state):
    for path in sorted(state.originals.glob("*.nii.gz")):
        image = nibabel.load(path)
        state.same(path.name, path, expected(image), image.affine)
    kinds = ["u1", "i1", "i2", "u2", "i4", "u4", "i8", "u8", "f4", "f8"]
    for version, kind, order, packed in itertools.product(
            (nibabel.Nifti1Image, nibabel.Nifti2Image), kinds, "<>", ("", ".gz")):
        header = version.header_class(endianness=order)
        header.set_data_dtype(numpy.dtype(kind).newbyteorder(order))
        image = version(pattern((9, 8, 7), kind).T, turned(), header)
        name = f"{version.__name__}_{kind}_{'be' if order == '>' else 'le'}.nii{packed}"
        nibabel.save(image, state.folder / name)
        image = nibabel.load(state.folder / name)
        state.same(name, state.folder / name, expected(image), image.affine)
    scaled = nibabel.Nifti1Image(pattern((9, 8, 7), "f4").T, turned())
    scaled.set_data_dtype("i2")  # nibabel chooses slope and intercept
    nibabel.save(scaled, state.folder / "scaled.nii.gz")
    image = nibabel.load(state.folder / "scaled.nii.gz")
    state.same("scaled", state.folder / "scaled.nii.gz", expected(image), image.affine, exact=False)
    series = nibabel.Nifti1Image(pattern((3, 4, 5, 6), "i2").T, turned())
    nibabel.save(series, state.folder / "series.nii.gz")
    image = nibabel.load(state.folder / "series.nii.gz")
    state.refused("series", state.folder / "series.nii.gz", "3 times", "--time")
    for t in range(3):
        state.same(f"time {t}", state.folder / "series.nii.gz", expected(image, t), image.affine,
                   ("--time", t))
    pair = nibabel.Nifti1Pair(pattern((9, 8, 7), "u2").T, turned())
    nibabel.save(pair, state.folder / "pair.img")
    for half in ("pair.hdr", "pair.img"):
        state.same(half, state.folder / half, pattern((9, 8, 7), "u2"), turned())
    # By qform alone.
    image = nibabel.Nifti1Image(pattern((9, 8, 7), "u2").T, turned())
    image.set_sform(None, 0)
    image.set_qform(turned(), 1)
    nibabel.save(image, state.folder / "qform.nii")
    state.same("qform", state.folder / "qform.nii", pattern((9, 8, 7), "u2"), turned())


if __name__ == "__main__":
    sys.exit(main(check))
