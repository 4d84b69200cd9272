"""Decodes bricks of the codec isobrick.packed with NumPy.

docs/reference/packed_codec.md in Isobrick's repository specifies the bytes.
"""

import numpy as np


def _bits(array, *shape):
    return np.unpackbits(array, bitorder="little").reshape(shape)


def _codes(data, code):
    """The codes [z, y, x] of a block without its base, and the axes of its differences."""
    axes, groups = int(data[0]), np.flatnonzero(_bits(data[1:5], 32))
    end = 5 + groups.size * 2 * code.itemsize
    present, sparse = _bits(data[5:end], -1, 2, 8 * code.itemsize).astype(bool).swapaxes(0, 1)
    columns_end = end + 2 * int(sparse.sum())
    there = np.repeat(present[..., np.newaxis], 16, axis=-1)
    there[sparse] = _bits(data[end:columns_end], -1, 16)
    planes = np.zeros((32, 8 * code.itemsize, 16), np.uint8)
    of_groups = np.zeros(there.shape, np.uint8)
    of_groups[there] = data[columns_end:]
    planes[groups] = of_groups
    # [group, plane, column, row] becomes [group, row, column, plane].
    bits = np.unpackbits(planes[..., np.newaxis], axis=-1, bitorder="little")
    packed = np.packbits(bits.transpose(0, 3, 2, 1), axis=-1, bitorder="little")
    return packed.view(code).reshape(16, 16, 16), axes


def _block(data, code, floating):
    base = data[: code.itemsize].view(code)[0]
    samples = np.zeros((16, 16, 16), code)
    top = code.type(1 << (8 * code.itemsize - 1))
    if data.size > code.itemsize:
        codes, axes = _codes(data[code.itemsize :], code)
        magnitude = codes >> code.type(1)
        samples = np.where(codes & code.type(1), code.type(0) - magnitude, magnitude)
        samples[codes == 1] = top
        for axis in range(3):
            if axes >> axis & 1:
                samples = np.cumsum(samples, axis=2 - axis, dtype=code)
    samples = samples + base
    return np.where(samples & top, samples ^ top, ~samples) if floating else samples


def decode(data, shape, dtype):
    """Samples [z, y, x] of a brick, from its bytes without the crc32c at their end."""
    data, dtype = np.frombuffer(data, np.uint8), np.dtype(dtype).newbyteorder("<")
    entries = int(data[2:4].view("<u2")[0])
    if data[0] != 1:
        raise ValueError(f"packed by version {data[0]}, not 1")
    if data[1] == 0:
        return data[4:].view(dtype).reshape(shape)
    code = np.dtype(f"<u{data[1]}")
    nz, ny, nx = (-(-extent // 16) for extent in shape)
    at = 4 + 4 * nz * ny * nx
    ends = data[4:at].view("<u4").astype(int)
    palette = data[at : at + entries * dtype.itemsize].view(dtype)
    blocks = data[at + palette.nbytes :]
    whole = np.empty((16 * nz, 16 * ny, 16 * nx), code)
    for number, (begin, end) in enumerate(zip([0, *ends], ends)):
        z, y, x = (16 * int(i) for i in np.unravel_index(number, (nz, ny, nx)))
        whole[z : z + 16, y : y + 16, x : x + 16] = _block(
            blocks[begin:end], code, dtype.kind == "f" and not entries
        )
    samples = np.ascontiguousarray(whole[: shape[0], : shape[1], : shape[2]])
    return palette[samples] if entries else samples.view(dtype)


try:
    from numcodecs.abc import Codec
except ImportError:
    pass
else:

    class Packed(Codec):
        """A codec of numcodecs; `shape` is that of a brick, [z, y, x]."""

        codec_id = "isobrick.packed"

        def __init__(self, shape, dtype):
            self.shape, self.dtype = tuple(shape), str(dtype)

        def encode(self, buf):
            raise NotImplementedError("isobrick convert --codec packed encodes")

        def decode(self, buf, out=None):
            samples = decode(buf, self.shape, self.dtype)
            if out is None:
                return samples
            np.copyto(np.frombuffer(out, samples.dtype).reshape(self.shape), samples)
            return out
