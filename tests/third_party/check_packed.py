"""The short decoder of packed bricks must find the samples that were packed.
    check_packed.py ISOBRICK READERS
Exit status: 0 equal, 1 different, 77 NumPy is missing."""

import json
import pathlib
import struct
import subprocess
import sys
import tempfile

try:
    import numpy as np
except ImportError:
    print("skipped: NumPy is not installed")
    sys.exit(77)

isobrick, readers = sys.argv[1:]
sys.path.insert(0, readers)
import packed  # noqa: E402

SHAPE, BRICK = (40, 33, 50), 24


def run(*words):
    subprocess.run([isobrick, *map(str, words)], check=True, stdout=subprocess.DEVNULL)


def fields(dtype):
    z, y, x = np.ogrid[: SHAPE[0], : SHAPE[1], : SHAPE[2]]
    wave = np.sin(x / 9) * np.cos(y / 7) + np.sin(z / 5)
    yield "smooth", (50 + 20 * wave).astype(dtype)
    noise = np.random.default_rng(3)
    yield "noisy", (50 + 20 * wave + noise.integers(0, 9, SHAPE)).astype(dtype)
    yield "labels", ((x // 7 + y // 5 + z // 3) % 4 * 30).astype(dtype)
    yield "chance", noise.integers(0, 256, (*SHAPE, np.dtype(dtype).itemsize), np.uint8).view(dtype)[..., 0]
    yield "sparse", (noise.integers(0, 50, SHAPE) // 49 * 100).astype(dtype)


def bricks(path, grid):
    """Of the only shard: each brick's bytes without its crc32c; nothing for absent ones."""
    shard = path.read_bytes()
    count = int(np.prod(grid))
    for i in range(count):
        offset, size = struct.unpack_from("<QQ", shard, len(shard) - 4 - 16 * (count - i))
        yield None if offset == 2**64 - 1 else shard[offset : offset + size - 4]


def check(folder, name, samples):
    raw, store = folder / "a.raw", folder / "a.zarr"
    samples.tofile(raw)
    types = {"u1": "u8", "i1": "i8", "u2": "u16", "i2": "i16", "u4": "u32", "i4": "i32"}
    code = samples.dtype.str[1:]
    run("convert", raw, store, "--dims", ",".join(map(str, SHAPE[::-1])), "--type",
        types.get(code, code.replace("4", "32").replace("8", "64")), "--brick", BRICK, "--shard",
        72, "--codec", "packed", "--force")
    metadata = json.loads((store / "0/zarr.json").read_text())
    shard = metadata["chunk_grid"]["configuration"]["chunk_shape"]
    grid = tuple(edge // BRICK for edge in shard)
    found = np.zeros(shard, samples.dtype)
    for number, data in enumerate(bricks(store / "0/c/0/0/0", grid)):
        if data is None:
            continue
        z, y, x = (BRICK * int(i) for i in np.unravel_index(number, grid))
        brick = packed.decode(data, (BRICK,) * 3, samples.dtype)
        found[z : z + BRICK, y : y + BRICK, x : x + BRICK] = brick
        if hasattr(packed, "Packed"):
            codec = packed.Packed((BRICK,) * 3, samples.dtype.str)
            assert codec.decode(data).tobytes() == brick.tobytes()
    if found[: SHAPE[0], : SHAPE[1], : SHAPE[2]].tobytes() != samples.tobytes():
        print(f"wrong: {samples.dtype} {name}")
        return 1
    return 0


with tempfile.TemporaryDirectory() as name:
    failures = sum(
        check(pathlib.Path(name), kind, samples)
        for dtype in ("<u1", "<i1", "<u2", "<i2", "<u4", "<i4", "<u8", "<i8", "<f4", "<f8")
        for kind, samples in fields(dtype)
    )
sys.exit(1 if failures else 0)
