"""Anisotropic and turned volumes of every format: their meshes lie in the world.

A ball is sampled on a turned grid with three spacings; whatever the format, the
mesh's bounds are the ball's, and so is its volume.
"""

import pathlib
import struct
import sys

from volume_check import main, numpy

CENTRE, RADIUS = numpy.array([12.0, -34.0, 56.0]), 10.0
SPACING = numpy.array([0.5, 0.8, 1.1])


def grid():
    """Shape (z, y, x) and the matrix from index (x, y, z) to world."""
    c, s = numpy.cos(0.4), numpy.sin(0.4)
    turn = numpy.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ numpy.array(
        [[1, 0, 0], [0, c, -s], [0, s, c]])
    size = numpy.array([60, 40, 30])
    affine = numpy.eye(4)
    affine[:3, :3] = turn * SPACING
    affine[:3, 3] = CENTRE - affine[:3, :3] @ ((size - 1) / 2)
    return size[::-1], affine


def ball(shape, affine):
    """f32 [z, y, x]: 100 at the surface, larger inside."""
    z, y, x = numpy.indices(shape)
    world = numpy.stack([x, y, z], -1) @ affine[:3, :3].T + affine[:3, 3]
    return (100 + RADIUS - numpy.linalg.norm(world - CENTRE, axis=-1)).astype("f4")


def read_stl(path):
    data = pathlib.Path(path).read_bytes()
    count, = struct.unpack_from("<I", data, 80)
    facets = numpy.frombuffer(data, numpy.dtype([("f", "<f4", 12), ("a", "<u2")]), count, 84)
    return facets["f"][:, 3:].reshape(-1, 3, 3).astype("f8")


def check_mesh(state, name, path, *options):
    state.checked += 1
    store, mesh = state.folder / "world.zarr", state.folder / "world.stl"
    for words in (["convert", path, store, "--force", *options],
                  ["extract", store, "--isovalue", "100", "-o", mesh, "--force"]):
        done = state.run(*words)
        if done.returncode != 0:
            state.failures.append(f"{name}: {done.stderr.strip()}")
            return
    corners = read_stl(mesh)
    low, high = corners.min((0, 1)), corners.max((0, 1))
    volume = numpy.einsum("ij,ij->i", corners[:, 0], numpy.cross(corners[:, 1],
                                                                  corners[:, 2])).sum() / 6
    exact = 4 / 3 * numpy.pi * RADIUS**3
    if not (numpy.allclose(low, CENTRE - RADIUS, atol=0.05) and
            numpy.allclose(high, CENTRE + RADIUS, atol=0.05)):
        state.failures.append(f"{name}: bounds {low} {high}")
    if abs(volume / exact - 1) > 0.01:  # negative when it is turned inside out
        state.failures.append(f"{name}: volume {volume}, not {exact}")


def write_nrrd(path, samples, affine):
    vectors = " ".join("({},{},{})".format(*axis) for axis in affine[:3, :3].T)
    path.write_bytes((
        "NRRD0004\ntype: float\ndimension: 3\nsizes: {} {} {}\nendian: little\nencoding: raw\n"
        "space dimension: 3\nspace directions: {}\nspace origin: ({},{},{})\n\n").format(
            *samples.shape[::-1], vectors, *affine[:3, 3]).encode() + samples.astype("<f4").tobytes())


def write_mha(path, samples, affine):
    turn = affine[:3, :3] / SPACING
    path.write_bytes((
        "NDims = 3\nDimSize = {} {} {}\nElementType = MET_FLOAT\nElementSpacing = {} {} {}\n"
        "TransformMatrix = {}\nOffset = {} {} {}\nElementDataFile = LOCAL\n").format(
            *samples.shape[::-1], *SPACING, " ".join(map(str, turn.T.ravel())),
            *affine[:3, 3]).encode() + samples.astype("<f4").tobytes())


def write_nifti(path, samples, affine):
    import nibabel
    nibabel.save(nibabel.Nifti1Image(samples.T, affine), path)


def write_vti(path, samples, affine):
    from check_vtk import make, write
    image = make(samples)
    image.SetExtent(0, samples.shape[2] - 1, 0, samples.shape[1] - 1, 0, samples.shape[0] - 1)
    image.SetSpacing(*SPACING)
    image.SetOrigin(*affine[:3, 3])
    image.SetDirectionMatrix(*(affine[:3, :3] / SPACING).ravel())
    write(image, path)


def check(state):
    shape, affine = grid()
    mirrored = affine.copy()
    mirrored[:3, :3] = affine[:3, :3] * [-1, 1, 1]
    mirrored[:3, 3] = CENTRE - mirrored[:3, :3] @ ((shape[::-1] - 1) / 2)
    for name, write in (("v.nrrd", write_nrrd), ("v.mha", write_mha), ("v.nii.gz", write_nifti),
                        ("v.vti", write_vti)):
        for kind, matrix in (("turned", affine), ("mirrored", mirrored)):
            if kind == "mirrored" and name == "v.mha":
                continue  # its spacings are positive, and so are ours here
            try:
                write(state.folder / name, ball(shape, matrix), matrix)
            except (ImportError, SystemExit):
                print(f"{name}: not checked, no library")
                break
            check_mesh(state, f"{kind} {name}", state.folder / name)
    # Given on the command line, for a file that lacks it.
    plain = numpy.diag([*SPACING, 1.0])
    plain[:3, 3] = CENTRE - SPACING * (shape[::-1] - 1) / 2
    (state.folder / "v.raw").write_bytes(ball(shape, plain).tobytes())
    check_mesh(state, "raw", state.folder / "v.raw", "--type", "f32",
               "--dims", ",".join(map(str, shape[::-1])), "--spacing", ",".join(map(str, SPACING)),
               "--origin", ",".join(map(str, plain[:3, 3])))


if __name__ == "__main__":
    sys.exit(main(check))
