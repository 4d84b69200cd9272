"""Writes Zarr version 2 with Zarr-Python and compares what isobrick makes of it.

  python3 check_zarr.py ISOBRICK [ORIGINAL]

Exit status: 0 equal, 1 different, 77 Zarr-Python is not installed.
"""

import itertools
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile

try:
    import numcodecs
    import numpy
    import zarr
except ImportError as error:
    print(f"skipped: {error}")
    sys.exit(77)

isobrick = sys.argv[1]
failures = 0
checks = 0


def run(*arguments, expect=0):
    result = subprocess.run([isobrick, *map(str, arguments)], capture_output=True, text=True)
    check(result.returncode == expect, f"{arguments}: {result.returncode} {result.stderr.strip()}")
    return result


def check(condition, what):
    global failures, checks
    checks += 1
    if not condition:
        failures += 1
        print(f"wrong: {what}")


def samples(shape, dtype, seed=0):
    """Smooth and then noisy values, so that compressors have something to do."""
    rng = numpy.random.default_rng(seed)
    grid = numpy.indices(shape).sum(axis=0)
    values = 60 + 50 * numpy.sin(grid / 5) + rng.integers(0, 9, shape)
    if numpy.dtype(dtype).kind == "i":
        values -= 64
    return values.astype(dtype)


def write_array(path, data, **options):
    options.setdefault("chunks", (8, 16, 20)[-data.ndim :] if data.ndim == 3 else None)
    array = zarr.open_array(
        str(path), mode="w", shape=data.shape, dtype=data.dtype, zarr_version=2, **options
    )
    array[...] = data
    return array


def expect_samples(folder, zarr_path, expected, *selection):
    """Both in place and through a conversion."""
    little = expected.astype(expected.dtype.newbyteorder("<"))
    for way in ("place", "store"):
        source = zarr_path
        if way == "store":
            source = folder / "converted.zarr"
            run("convert", zarr_path, source, "--brick", 16, "--force", *selection)
        chosen = selection if way == "place" else ()
        raw = folder / "out.raw"
        run("export", source, raw, "--force", *chosen)
        check(raw.read_bytes() == little.tobytes(), f"{zarr_path.name} {selection} by {way}")


def write_image(path, levels, axes, scales, **options):
    """An OME-NGFF 0.4 image."""
    group = zarr.open_group(str(path), mode="w", zarr_version=2)
    datasets = []
    for i, data in enumerate(levels):
        write_array(path / str(i), data, dimension_separator="/", **options)
        datasets.append(
            {
                "path": str(i),
                "coordinateTransformations": [{"type": "scale", "scale": scales[i]}],
            }
        )
    group.attrs["multiscales"] = [{"version": "0.4", "axes": axes, "datasets": datasets}]


def axis(name, kind, unit=None):
    return {"name": name, "type": kind, **({"unit": unit} if unit else {})}


SPACE = [axis(name, "space", "micrometer") for name in "zyx"]


def check_types(folder):
    for code, order in itertools.product(("u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f4", "f8"), "<>"):
        data = samples((19, 33, 41), order + code)
        path = folder / f"type_{code}_{'little' if order == '<' else 'big'}.zarr"
        write_array(path, data, compressor=numcodecs.Zlib(3))
        expect_samples(folder, path, data)


def check_wide_types(folder):
    """Types that ours are not, as what they become."""
    for code, becomes in (("<f2", "f4"), (">f2", "f4"), ("|b1", "u1")):
        data = samples((19, 33, 41), "<i2")
        data = data > 60 if code == "|b1" else data.astype(code)
        path = folder / f"type_{code[1:]}_{'big' if code[0] == '>' else 'little'}.zarr"
        write_array(path, data, compressor=numcodecs.Zlib(3))
        expect_samples(folder, path, data.astype(becomes))


def check_wide_integers(folder):
    """Labels beyond what doubles hold: stay exact, in our stores too, but make no isosurface."""
    for code, ends in (("<u8", (2**53 + 1, 2**64 - 1)), (">i8", (-(2**63), 2**63 - 1))):
        path, store = folder / f"large_{code[1:]}.zarr", folder / f"large_{code[1:]}_ours.zarr"
        data = numpy.zeros((5, 6, 7), code)
        data[4, 5, 6], data[0, 0, 0] = ends
        write_array(path, data, fill_value=ends[1])
        expect_samples(folder, path, data)
        run("convert", path, store, "--downsample", "mode")
        info = json.loads(run("info", store, "--json").stdout)
        check(info["fill_value"] == ends[1] and info["type"] == data.dtype.name, f"info: {info}")
        metadata = json.loads((store / "0" / "zarr.json").read_text())
        check(metadata["fill_value"] == ends[1] and metadata["data_type"] == data.dtype.name,
              f"metadata: {metadata}")
        version_2 = folder / f"large_{code[1:]}_v2.zarr"
        run("convert", path, version_2, "--downsample", "mode", "--ome", "0.4")
        theirs = zarr.open_group(str(version_2), mode="r")["0"]
        check(theirs.dtype == data.dtype.newbyteorder("=") and (theirs[:] == data).all()
              and theirs.fill_value == ends[1], f"{code} by zarr-python")
    errors = run("extract", folder / "large_u8_ours.zarr", "--isovalue", 1, "-o", folder / "no.ply",
                 expect=1).stderr
    check("no float64" in errors and errors.count("\n") == 1, f"large: {errors}")


def check_compressors(folder):
    data = samples((19, 33, 41), "<u2")
    compressors = {
        "none": None,
        "zlib": numcodecs.Zlib(5),
        "gzip": numcodecs.GZip(5),
        "zstd": numcodecs.Zstd(5),
        "lz4": numcodecs.LZ4(),
    }
    for cname, shuffle in itertools.product(numcodecs.blosc.list_compressors(), (0, 1, 2)):
        compressors[f"blosc_{cname}_{shuffle}"] = numcodecs.Blosc(cname, 5, shuffle)
    for name, compressor in compressors.items():
        for separator in "./":
            path = folder / f"{name}_{'dot' if separator == '.' else 'slash'}.zarr"
            write_array(path, data, compressor=compressor, dimension_separator=separator)
            expect_samples(folder, path, data)


def check_fill_values(folder):
    for dtype, fill in (("<i2", -7), ("<f4", float("nan")), ("<f8", float("-inf")), ("|u1", None),
                        ("<f4", 0.1)):
        data = samples((20, 33, 41), dtype)
        path = folder / f"fill_{dtype[1:]}_{fill}.zarr"
        array = write_array(path, data, fill_value=fill)
        # Two chunks are lost, which in Zarr means that nothing was written there.
        (path / "1.1.1").unlink()
        (path / "0.0.0").unlink()
        # Zarr-Python leaves what it does not know as it finds it in memory.
        expected = array[...] if fill is not None else data.copy()
        if fill is None:
            expected[8:16, 16:32, 20:40] = 0
            expected[0:8, 0:16, 0:20] = 0
        expect_samples(folder, path, expected)


def check_channels_and_times(folder):
    data = samples((2, 3, 19, 33, 41), "<u2")
    levels = [data, data[:, :, ::2, ::2, ::2]]
    scales = [[1, 1, 2.0, 0.5, 0.25], [1, 1, 4.0, 1.0, 0.5]]
    for name, chunks in (("one", (1, 1, 8, 16, 20)), ("some", (2, 2, 8, 16, 20))):
        path = folder / f"channels_{name}.zarr"
        write_image(path, levels, [axis("t", "time"), axis("c", "channel"), *SPACE], scales,
                    chunks=chunks)
        for time, channel in itertools.product(range(2), range(3)):
            expect_samples(folder, path, data[time, channel], "--time", time, "--channel", channel)
        errors = run("export", path, folder / "no.raw", expect=2).stderr
        check("2 times" in errors and "--time" in errors, f"ambiguous: {errors}")
        listed = json.loads(run("info", path, "--json").stdout)
        check([(a["name"], a["count"], a["options"]) for a in listed["axes"]]
              == [("t", 2, ["--time"]), ("c", 3, ["--channel"])], f"listed: {listed}")
        check(listed["extent"] == [41, 33, 19] and len(listed["levels"]) == 2, f"listed: {listed}")
        check("3 volumes: --channel 0 … 2" in run("info", path, "--time", 0).stdout, "listed")
        errors = run("info", path, "--time", 1, "--channel", 3, expect=2).stderr
        check("--channel 3 is not there" in errors, f"not there: {errors}")
        check_in_place(folder, path, data[1, 2], "--time", 1, "--channel", 2)
        # Each volume has ranges of its own.
        check_in_place(folder, path, data[0, 1], "--time", 0, "--channel", 1)
    single = folder / "single.zarr"
    write_image(single, [data[:1, :1]], [axis("t", "time"), axis("c", "channel"), *SPACE], scales)
    expect_samples(folder, single, data[0, 0])
    four = folder / "four.zarr"
    write_array(four, data[0], chunks=(2, 8, 16, 20))
    expect_samples(folder, four, data[0, 1], "--channel", 1)
    expect_samples(folder, four, data[0, 2], "--time", 2)
    errors = run("export", four, folder / "no.raw", expect=2).stderr
    check("choose one" in errors, f"ambiguous: {errors}")
    check("--channel or --time 0 … 2" in run("info", four).stdout, "a fourth axis is listed")


def check_in_place(folder, path, expected, *selection):
    """Indexed and extracted as it is, equal to the mesh of our own store."""
    raw = folder / "same.raw"
    raw.write_bytes(expected.tobytes())
    z, y, x = expected.shape
    run("convert", raw, folder / "same.zarr", "--dims", f"{x},{y},{z}", "--type", "u16",
        "--spacing", "0.25,0.5,2", "--unit", "micrometer", "--brick", 16, "--force")
    run("index", path, "--kind", "octree", *selection)
    meshes = []
    for store, chosen in ((path, selection), (folder / "same.zarr", ())):
        mesh = folder / f"{len(meshes)}.ply"
        run("extract", store, "--isovalue", 77.5, "--normals", "gradient", "-o", mesh, "--force",
            *chosen)
        meshes.append(mesh.read_bytes())
    check(meshes[0] == meshes[1] and len(meshes[0]) > 100_000, f"{path.name}: mesh")
    run("verify", path, *selection)
    info = json.loads(run("info", path, "--json", *selection).stdout)
    check(info["spacing"] == [0.25, 0.5, 2.0] and info["unit"] == "micrometer",
          f"{path.name}: {info['spacing']} {info['unit']}")


def check_written(folder):
    """What we write as OME-Zarr 0.4 is what Zarr-Python reads, and the same store to us."""
    for code, name in (("|u1", "u8"), ("<i2", "i16"), ("<u4", "u32"), ("<f4", "f32"), ("<f8", "f64")):
        data = samples((37, 70, 91), code)
        data[:16, :16, :16] = 0
        raw = folder / f"{name}.raw"
        raw.write_bytes(data.tobytes())
        for codec in ("zstd:3", "none"):
            stores = []
            for version in ("0.4", "0.5"):
                stores.append(folder / f"{name}_{codec[:4]}_{version}.zarr")
                run("convert", raw, stores[-1], "--dims", "91,70,37", "--type", name, "--brick", 16,
                    "--spacing", "0.5,0.5,2", "--unit", "um", "--codec", codec, "--ome", version,
                    "--build-index", "octree")
            check_as_zarr_2(stores[0], data)
            run("verify", stores[0])
            meshes = []
            for store in stores:
                meshes.append(folder / "mesh.ply")
                run("extract", store, "--isovalue", 30.5, "-o", meshes[-1], "--force")
                meshes[-1] = meshes[-1].read_bytes()
            check(meshes[0] == meshes[1] and len(meshes[0]) > 100_000, f"{name}: mesh")
            expect_samples(folder, stores[0], data)


def check_as_zarr_2(store, data):
    group = zarr.open_group(str(store), mode="r")
    image = group.attrs["multiscales"][0]
    check(image["version"] == "0.4" and [a["unit"] for a in image["axes"]] == ["micrometer"] * 3,
          f"{store.name}: {image}")
    check(numpy.array_equal(group["0"][...], data), f"{store.name}: level 0")
    check(group["0"].nchunks_initialized < group["0"].nchunks, f"{store.name}: an absent chunk")
    window = group.attrs["omero"]["channels"][0]["window"]
    check((window["min"], window["max"]) == (data.min(), data.max()), f"{store.name}: {window}")
    shape = data.shape
    for dataset in image["datasets"][1:]:
        factors = [-(-a // b) for a, b in zip(shape, group[dataset["path"]].shape)]
        check(set(factors) <= {1, 2} and factors != [1, 1, 1], f"{store.name}: {factors}")
        shape = group[dataset["path"]].shape
        check(group[dataset["path"]][...].any(), f"{store.name}: {dataset['path']}")


def check_refusals(folder):
    path = folder / "a.zarr"
    data = samples((5, 6, 7), "<u2")

    def refused(part, change=None, **options):
        write_array(path, data, **options)
        if change:
            meta = json.loads((path / ".zarray").read_text())
            meta.update(change)
            (path / ".zarray").write_text(json.dumps(meta))
        errors = run("info", path, expect=1).stderr
        check(part in errors and errors.count("\n") == 1, f"{part!r} is not in {errors!r}")
        shutil.rmtree(path)

    refused("order 'F'", order="F")
    refused("filter 'delta'", filters=[numcodecs.Delta("<u2")])
    refused("'bz2'", compressor=numcodecs.BZ2())
    refused("'<c8'", {"dtype": "<c8"})
    refused("structured", {"dtype": [["a", "<u2"]]})
    refused("out of bounds", {"shape": [2**61, 4, 5], "chunks": [1, 1, 1]})
    refused("bytes at a time", {"chunks": [2**40, 4, 5]})
    refused("0 is out of bounds", {"chunks": [0, 4, 5]})
    refused("dimensions", {"shape": [4, 5], "chunks": [4, 5]})
    refused("zarr_format", {"zarr_format": 7})
    zarr.open_group(str(path), mode="w", zarr_version=2)
    errors = run("info", path, expect=1).stderr
    check("no image" in errors, errors)
    zarr.open_group(str(path), mode="a").attrs["multiscales"] = [{"version": "0.2"}]
    errors = run("info", path, expect=1).stderr
    check("0.2" in errors, errors)


def check_damage(folder):
    """Chunks cut off, lengthened, or with changed bytes: one line, no samples."""
    data = samples((16, 32, 40), "<u2")
    rng = numpy.random.default_rng(1)
    compressors = (numcodecs.Zlib(1), numcodecs.GZip(1), numcodecs.Zstd(1), numcodecs.LZ4(),
                   numcodecs.Blosc("lz4", 5, 1), numcodecs.Blosc("zstd", 5, 2))
    for compressor in compressors:
        path = folder / "damaged.zarr"
        write_array(path, data, compressor=compressor, chunks=data.shape)
        chunk = path / "0.0.0"
        whole = chunk.read_bytes()
        for broken in (b"", whole[:7], whole[: len(whole) // 2], whole[:-1], b"\xff" * 40,
                       whole[:4] + b"\xff" * 12 + whole[16:]):
            chunk.write_bytes(broken)
            result = subprocess.run([isobrick, "export", path, folder / "x.raw", "--force"],
                                    capture_output=True, text=True)
            check(result.returncode == 1 and "0.0.0" in result.stderr
                  and result.stderr.count("\n") == 1,
                  f"{compressor}: {result.returncode} {result.stderr!r}")
        for _ in range(20):  # never a crash; not every format has a checksum
            broken = bytearray(whole)
            for at in rng.integers(0, len(whole), 3):
                broken[at] = rng.integers(0, 256)
            chunk.write_bytes(bytes(broken))
            code = subprocess.run([isobrick, "export", path, folder / "x.raw", "--force"],
                                  capture_output=True).returncode
            check(code in (0, 1), f"{compressor}: {code}")


def main() -> int:
    with tempfile.TemporaryDirectory() as name:
        for part in (check_types, check_wide_types, check_wide_integers, check_compressors, check_fill_values,
                     check_channels_and_times, check_written, check_refusals, check_damage):
            folder = pathlib.Path(name) / part.__name__
            folder.mkdir()
            part(folder)
            shutil.rmtree(folder)
    print(f"{checks} checks, {failures} failures")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
