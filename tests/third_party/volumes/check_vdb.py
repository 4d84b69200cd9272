"""OpenVDB grids of others, and ones that OpenVDB writes, beside its own accessor."""

import filecmp
import itertools
import json
import sys
import time

from volume_check import main, numpy, pattern

try:
    import pyopenvdb as vdb
except ImportError as error:
    print(f"skipped: {error}")
    sys.exit(77)


def dense(grid, box=None):
    """Samples [z, y, x] of the box of active voxels (or of `box`, inclusive) and where they are."""
    low, high = box or grid.evalActiveVoxelBoundingBox()
    array = numpy.zeros([b - a + 1 for a, b in zip(low, high)],
                        numpy.uint8 if grid.valueTypeName == "bool" else numpy.float32)
    if grid.valueTypeName == "bool":
        bits = numpy.zeros(array.shape, bool)
        grid.copyToArray(bits, ijk=low)
        array[...] = bits
    else:
        grid.copyToArray(array, ijk=low)
    affine = numpy.eye(4)
    at = lambda i: numpy.array(grid.transform.indexToWorld(i))
    affine[:3, 3] = at(low)
    for axis in range(3):
        affine[:3, axis] = at(tuple(v + (axis == a) for a, v in enumerate(low))) - at(low)
    return array.transpose(2, 1, 0), affine


def originals(state):
    for path in sorted((state.originals.parent / "vdb").glob("*.vdb")):
        grids, _ = vdb.readAll(str(path)) if path.name != "points.vdb" else ([], None)
        scalar = [g for g in grids if g.valueTypeName in ("float", "bool")]
        names = [g.name for g in grids]
        for grid in scalar:
            name = grid.name
            if names.count(name) > 1:
                same = [g for g in grids if g.name == name]
                name += f"[{[g is grid for g in same].index(True)}]"
            samples, affine = dense(grid)
            state.same(f"{path.name} {name}", path, samples, affine, options=("--grid", name))
        if len(scalar) > 1:
            state.refused(path.name, path, "--grid", "density")
        for grid in grids:
            if grid not in scalar and names.count(grid.name) == 1:
                state.refused(f"{path.name} {grid.name}", path, "float, double",
                              options=("--grid", grid.name))
        if not grids:
            state.refused(path.name, path, "ptdataidx32")


def written(state):
    path = state.folder / "v.vdb"
    transforms = {
        "plain": vdb.createLinearTransform(0.25),
        "anisotropic": vdb.createLinearTransform([[0.5, 0, 0, 0], [0, 2, 0, 0], [0, 0, 3, 0],
                                                  [-7, 8, 9.5, 1]]),
    }
    turned = vdb.createLinearTransform(0.75)
    turned.rotate(0.6, vdb.Axis.X)
    turned.rotate(-0.3, vdb.Axis.Z)
    turned.translate((4, -5, 6))
    transforms["rotated"] = turned
    for (name, transform), background in itertools.product(
            transforms.items(), (0.0, -3.5, float("nan"), float("inf"))):
        grid = vdb.FloatGrid(background)
        grid.transform = transform
        samples = pattern((21, 34, 19), "f4").transpose(2, 1, 0)
        grid.copyFromArray(numpy.ascontiguousarray(samples), ijk=(-9, 100, -30))
        grid.fill((0, 0, 0), (40, 30, 35), 2.5)  # tiles
        grid.fill((16, 8, 8), (23, 15, 23), 9.0, False)  # inactive values of their own
        grid.fill((3, 3, 3), (5, 5, 5), -1.0, False)
        grid.name = "field"
        for half in (False, True):
            grid.saveFloatAsHalf = half
            vdb.write(str(path), [grid])
            expected, affine = dense(vdb.read(str(path), "field"))
            # Bricks of 24 are converted like those of a dense volume.
            for options in ((), ("--brick", "24"), ("--brick", "16", "--shard", "64"))[:3 if half else 1]:
                state.same(f"{name} {background} {half} {options}", path, expected, affine, options)
    box = ((-20, 90, -40), (10, 120, 3))
    expected, affine = dense(grid, box)
    state.same("region", path, dense(vdb.read(str(path), "field"), box)[0], affine,
               options=("--bounds=-20:11,90:121,-40:4",))

    bits = vdb.BoolGrid(True)
    bits.fill((0, 0, 0), (9, 8, 7), False)
    bits.fill((20, 0, 0), (21, 8, 7), True)
    vdb.write(str(path), [bits])
    state.same("bool", path, *dense(bits))

    flat = vdb.FloatGrid(1.0)
    flat.transform = vdb.createFrustumTransform(taper=0.5, depth=10.0, xyzMin=(0, 0, 0),
                                                xyzMax=(10, 10, 10), voxelSize=0.5)
    flat.fill((0, 0, 0), (5, 5, 5), 2.0)
    vdb.write(str(path), [flat])
    state.refused("frustum", path, "frustum")
    sheared = vdb.FloatGrid(1.0)
    sheared.transform.shear(0.5, vdb.Axis.X, vdb.Axis.Y)
    sheared.fill((0, 0, 0), (5, 5, 5), 2.0)
    vdb.write(str(path), [sheared])
    state.refused("shear", path, "right angles")
    vdb.write(str(path), [vdb.FloatGrid(1.0)])
    state.refused("empty", path, "no active voxels")
    path.write_bytes(b" BDV" + bytes(4) + b"\xff" * 200)
    state.refused("version", path, "v.vdb")


def damaged(state):
    """Every cut and many changes: one line or a volume, at once."""
    path = state.folder / "d.vdb"
    grid = vdb.FloatGrid(0.5)
    grid.copyFromArray(pattern((12, 20, 17), "f4"), ijk=(-5, -5, -5))
    vdb.write(str(path), [grid])
    sound = path.read_bytes()
    places = [*range(0, 900, 23), *range(900, len(sound), max(1, len(sound) // 40))]
    for place in places:
        for what, content in (("cut", sound[:place]),
                              ("changed", sound[:place] + b"\xff\xff\xff\x7f" + sound[place + 4:])):
            path.write_bytes(content)
            state.checked += 1
            start = time.monotonic()
            done = state.run("convert", path, state.folder / "d.zarr", "--force", "--memory", "512M")
            seconds = time.monotonic() - start
            lines = done.stderr.strip().splitlines()
            sound_end = done.returncode == 0 and what == "changed"
            if seconds > 5 or not (sound_end or done.returncode in (1, 2) and len(lines) == 1):
                state.failures.append(f"{what} at {place}: exit {done.returncode}, {seconds:.1f} s, "
                                      f"{done.stderr[-300:]!r}")


def there_and_back(state):
    """A sparse and a dense conversion of the same samples, and the way back."""
    paths = {name: state.folder / name for name in
             ("s.vdb", "s.raw", "a.zarr", "b.zarr", "c.zarr", "out.vdb", "x", "y")}
    grid = vdb.createLevelSetSphere(radius=2.7, center=(0.3, 0.1, -0.2), voxelSize=0.0457)
    vdb.write(str(paths["s.vdb"]), [grid])
    samples, affine = dense(grid)
    samples.tofile(paths["s.raw"])
    dims = ",".join(map(str, samples.shape[::-1]))
    bricks = ("--brick", "16", "--shard", "64")
    steps = [("convert", paths["s.vdb"], paths["a.zarr"], "--build-index", "octree", *bricks),
             ("convert", paths["s.raw"], paths["b.zarr"], "--dims", dims, "--type", "f32", *bricks),
             ("export", paths["a.zarr"], paths["out.vdb"]),
             ("convert", paths["out.vdb"], paths["c.zarr"], *bricks),
             ("verify", paths["a.zarr"])]
    for words in steps:
        state.checked += 1
        done = state.run(*words)
        if done.returncode != 0:
            state.failures.append(f"{' '.join(map(str, words))}: {done.stderr}")
            return
    info = {name: json.loads(state.run("info", paths[f"{name}.zarr"], "--stats", "--json").stdout)
            for name in "abc"}
    for level in range(len(info["b"]["levels"])):
        contents = []
        for name in "abc":
            state.run("export", paths[f"{name}.zarr"], paths["x"], "--level", level, "--force")
            contents.append(paths["x"].read_bytes())
        state.checked += 1
        if contents[0] != contents[1] or contents[0] != contents[2]:
            state.failures.append(f"level {level}: {[a == contents[1] for a in contents]}")
    for key in ("extent", "grid_class", "fill_value", "value_range"):
        if info["a"][key] != info["c"][key]:
            state.failures.append(f"{key}: {info['a'][key]} became {info['c'][key]}")
    if info["a"]["value_range"] != info["b"]["value_range"] or info["a"]["grid_class"] != "level set":
        state.failures.append(f"{info['a']} instead of {info['b']}")
    if info["a"]["levels"][0]["bricks_stored"] >= info["b"]["levels"][0]["bricks_stored"]:
        state.failures.append("no brick is absent")
    for isovalue in (0, 0.02):
        state.checked += 1
        for name, out in (("a", "x"), ("c", "y")):
            done = state.run("extract", paths[f"{name}.zarr"], "--isovalue", isovalue, "-o", paths[out],
                             "--format", "ply", "--force")
            if done.returncode != 0:
                state.failures.append(done.stderr)
        if not filecmp.cmp(paths["x"], paths["y"], shallow=False):
            state.failures.append(f"other mesh at {isovalue}")
    # The mesh is where the sphere is: world coordinates.
    done = state.run("extract", paths["a.zarr"], "--isovalue", 0, "-o", state.folder / "m.obj")
    if done.returncode == 0:
        points = numpy.array([line.split()[1:4] for line in open(state.folder / "m.obj")
                              if line.startswith("v ")], float)
        radii = numpy.linalg.norm(points - (0.3, 0.1, -0.2), axis=1)
        if abs(radii - 2.7).max() > 0.002:
            state.failures.append(f"radii from {radii.min()} to {radii.max()}")
    else:
        state.failures.append(done.stderr)


def huge(state):
    """Four voxels in a box of 5·10¹¹: nothing may follow the box."""
    path, store = state.folder / "huge.vdb", state.folder / "huge.zarr"
    grid = vdb.FloatGrid(-1.0)
    for at in ((0, 0, 0), (8000, 8000, 8000), (4000, 3, 7000), (63, 64, 511)):
        grid.fill(at, at, 3.0)
    vdb.write(str(path), [grid])
    start = time.monotonic()
    done = state.run("convert", path, store, "--memory", "512M", "--json")
    seconds = time.monotonic() - start
    state.checked += 1
    if done.returncode != 0 or seconds > 60:
        state.failures.append(f"huge: exit {done.returncode}, {seconds:.1f} s {done.stderr}")
        return
    report = json.loads(done.stdout)
    if report["peak_resident_bytes"] > 400 << 20:
        state.failures.append(f"huge: {report}")
    info = json.loads(state.run("export", store, state.folder / "h.raw", "--roi",
                                "3999:4002,2:5,6999:7002", "--json").stdout)
    got = numpy.fromfile(state.folder / "h.raw", numpy.float32).reshape(3, 3, 3)
    expected = numpy.full((3, 3, 3), -1, numpy.float32)
    expected[1, 1, 1] = 3
    if not numpy.array_equal(got, expected):
        state.failures.append(f"huge: {got} {info}")


def check(state):
    originals(state)
    written(state)
    damaged(state)
    there_and_back(state)
    huge(state)


if __name__ == "__main__":
    sys.exit(main(check))
