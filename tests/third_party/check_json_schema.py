"""Validates what every command writes with --json against docs/reference/json_schema.json.

  python3 check_json_schema.py ISOBRICK JSON_SCHEMA JSON_OUTPUT_MD

Exit status: 0 valid, 1 not, 77 the library jsonschema is not installed.
"""

import json
import pathlib
import re
import subprocess
import sys
import tempfile

try:
    from jsonschema import Draft202012Validator
except ImportError as error:
    print(f"skipped: {error}")
    sys.exit(77)

ONE_OF_SEVERAL = ["view_window"]  # a window, which needs a display


class Checker:
    def __init__(self, isobrick, schema, folder):
        self.isobrick, self.schema, self.folder = isobrick, schema, folder
        self.failures, self.seen = [], set()

    def fail(self, text):
        self.failures.append(text)
        print(text)

    def validate(self, name, text, words):
        """Checks a line against the definition `name` of the schema, and against no other."""
        self.seen.add(name)
        try:
            value = json.loads(text)
        except json.JSONDecodeError as error:
            return self.fail(f"{words}: {error}: {text!r}")
        part = {**self.schema, "anyOf": [{"$ref": f"#/$defs/{name}"}]}
        for error in Draft202012Validator(part).iter_errors(value):
            inner = max(error.context, key=lambda e: len(e.path), default=error)
            self.fail(f"{words}: not {name}: {inner.json_path}: {inner.message}")

    def run(self, name, *words, exit_code=0):
        result = subprocess.run([self.isobrick, *words, "--json"], cwd=self.folder,
                                capture_output=True, text=True)
        if result.returncode != exit_code:
            return self.fail(f"{words}: exit code {result.returncode}: {result.stderr}")
        self.validate(name, result.stdout, words)


def write_image(path):
    """An OME-Zarr image of two channels, without chunks: all samples are the fill value."""
    (path / "0").mkdir(parents=True)
    (path / ".zgroup").write_text('{"zarr_format": 2}')
    axes = [{"name": "c", "type": "channel"}] + [{"name": n, "type": "space"} for n in "zyx"]
    transform = [{"type": "scale", "scale": [1, 1, 1, 1]}]
    (path / ".zattrs").write_text(json.dumps({
        "multiscales": [{"version": "0.4", "axes": axes, "datasets": [
            {"path": "0", "coordinateTransformations": transform}]}],
        "omero": {"channels": [{"label": "DAPI"}, {"label": "GFP"}]}}))
    (path / "0" / ".zarray").write_text(json.dumps({
        "zarr_format": 2, "shape": [2, 8, 8, 8], "chunks": [1, 8, 8, 8], "dtype": "|u1",
        "compressor": None, "fill_value": 0, "order": "C", "filters": None,
        "dimension_separator": "/"}))


def damage(store):
    """Changes the last byte of the largest shard."""
    shards = [path for path in (store / "0").rglob("*") if path.is_file()]
    shard = max(shards, key=lambda path: path.stat().st_size)
    data = bytearray(shard.read_bytes())
    data[len(data) // 2] ^= 255
    shard.write_bytes(data)


def run_commands(check):
    folder = check.folder
    check.run("synth", "synth", "gyroid", "a.zarr", "--dims", "40,36,33", "--type", "u8",
              "--brick", "16", "--build-index", "octree")
    check.run("synth", "synth", "sphere", "b.raw", "--dims", "9,8,7", "--type", "f32")
    check.run("export", "export", "a.zarr", "a.nrrd")
    check.run("convert", "convert", "a.nrrd", "c.zarr")
    check.run("convert", "convert", "a.nrrd", "p.zarr", "--part", "1/1")
    check.run("convert", "convert", "a.nrrd", "p.zarr", "--join", "1")
    check.run("recode", "recode", "a.zarr", "r.zarr")
    check.run("recode", "recode", "a.zarr", "z.zarr", "--codec", "zstd:5")
    check.run("convert", "convert", "a.nrrd", "auto.zarr", "--codec", "auto")
    check.run("index", "index", "c.zarr", "--kind", "kdtree", "--leaf", "4")
    check.run("index", "index", "c.zarr", "--kind", "quadtree", "--leaf", "8", "--part", "1/1")
    check.run("index", "index", "c.zarr", "--kind", "quadtree", "--leaf", "8", "--join", "1")
    for options in ([], ["--stats"]):
        check.run("info", "info", "a.zarr", *options)
        check.run("info", "info", "a.nrrd", *options)
    write_image(folder / "image.zarr")
    check.run("info_volumes", "info", "image.zarr")
    check.run("info", "info", "image.zarr", "--channel", "1")
    check.run("verify", "verify", "a.zarr")
    check.run("extract", "extract", "a.zarr", "--isovalue", "120,130", "-o", "m.ply",
              "--drop-degenerate", "--backend", "cpu")
    check.run("extract", "extract", "a.zarr", "--isovalue", "128", "-o", "m.stl")
    check.run("extract", "extract", "a.zarr", "--isovalue", "128", "-o", "f.ply", "--measure",
              "--smooth", "2", "--min-component", "10")
    check.run("extract", "extract", "a.zarr", "--isovalue", "128", "-o", "f.stl", "--measure",
              "--largest", "1")
    check.run("extract", "extract", "a.zarr", "--isovalue", "1000", "-o", "none.ply", "--measure")
    for output in ("e.ply", "e.stl"):
        check.run("extract_estimate", "extract", "a.zarr", "--isovalue", "128", "--estimate",
                  "-o", output)
    check.run("extract", "extract", "a.zarr", "--isovalue", "120,128", "-o", "r.ply", "--resume",
              "--largest", "1", "--measure")
    check.run("extract_part", "extract", "a.zarr", "--isovalue", "128", "--part", "1/1",
              "--drop-degenerate", "-o", "a.piece")
    check.run("extract_part", "extract", "a.zarr", "--isovalue", "128", "--part", "1/1",
              "--drop-degenerate", "-o", "a.piece")
    for options in ([], ["--simplify", "50%", "--measure"]):
        check.run("merge", "merge", "a.piece", "-o", "p.ply", "--force", *options)
    check.run("merge", "merge", "a.piece", "-o", "a.vtp", "--attribute", "c=c.zarr")
    check.run("merge", "merge", "a.piece", "-o", "p.stl")
    check.run("synth", "synth", "cells", "cells.zarr", "--dims", "30,30,30", "--type", "u8")
    check.run("extract_labels", "extract", "cells.zarr", "--labels", "all", "-o", "meshes",
              "--measure")
    check.validate("label_list", (folder / "meshes" / "labels.json").read_text(), "labels.json")
    check.run("index", "index", "cells.zarr", "--kind", "labels")
    check.run("info", "info", "cells.zarr")
    check.run("extract_labels", "extract", "cells.zarr", "--labels", "3", "-o", "third")
    check.run("extract_labels", "extract", "cells.zarr", "--labels", "all", "-o", "resumed",
              "--resume")
    for _ in range(2):
        check.run("extract_label_part", "extract", "cells.zarr", "--labels", "all", "--part", "1/1",
                  "-o", "l.piece")
    check.run("merge_labels", "merge", "l.piece", "-o", "merged")
    for command in (["man"], ["completion", "bash"], ["help", "info"]):
        check.run("text", *command)
    if "not in this program" not in subprocess.run([check.isobrick, "help", "view"], text=True,
                                                   capture_output=True).stdout:
        check.run("render", "render", "m_120.ply", "-o", "m.png", "--size", "64x48")
        check.run("view", "view", "a.zarr", "--isovalue", "128", "--screenshot", "v.png",
                  "--size", "64x48")
    else:
        check.seen.update(["render", "view"])


def run_failures(check):
    check.run("failure", "info", "none.zarr", exit_code=1)
    check.run("failure", "extract", "a.zarr", "--isovalue", "x", exit_code=2)
    check.run("failure", "nonsense", exit_code=2)
    damage(check.folder / "c.zarr")
    check.run("verify", "verify", "c.zarr", exit_code=1)
    lines = subprocess.run([check.isobrick, "convert", "a.nrrd", "d.zarr", "--progress", "json"],
                           cwd=check.folder, capture_output=True, text=True).stderr.splitlines()
    if not lines:
        check.fail("convert: no progress")
    for line in lines:
        check.validate("progress", line, "convert --progress json")


def members(schema):
    """The names of all members that the schema has."""
    if isinstance(schema, dict):
        if isinstance(schema.get("properties"), dict):
            yield from schema["properties"]
        for value in schema.values():
            yield from members(value)
    elif isinstance(schema, list):
        for value in schema:
            yield from members(value)


def check_coverage(check, document):
    """Every kind of object was written, every subcommand ran, every member is documented."""
    kinds = [option["$ref"].split("/")[-1] for option in check.schema["anyOf"]] + ["progress"]
    for kind in set(kinds) - check.seen - set(ONE_OF_SEVERAL):
        check.fail(f"no command wrote the object {kind}")
    text = subprocess.run([check.isobrick, "--help"], capture_output=True, text=True).stdout
    commands = re.findall(r"^  ([a-z]+) ", text[text.index("Subcommands:"):], re.M)
    known = json.dumps([check.schema["$defs"][kind] for kind in kinds])
    for command in commands:
        if f'"{command}"' not in known:
            check.fail(f"the schema does not have the subcommand {command}")
    documented = set(re.findall(r"`\"?(\w+)\"?`", document))
    documented |= set(re.findall(r"\"(\w+)\"", document))
    for member in sorted(set(members(check.schema)) - documented):
        check.fail(f"json_output.md does not mention the member {member}")


def main():
    isobrick, schema, document = map(pathlib.Path, sys.argv[1:4])
    schema = json.loads(schema.read_text())
    Draft202012Validator.check_schema(schema)
    with tempfile.TemporaryDirectory() as folder:
        check = Checker(isobrick.resolve(), schema, pathlib.Path(folder))
        run_commands(check)
        run_failures(check)
        check_coverage(check, document.read_text())
    print(f"{len(check.failures)} failures")
    return 1 if check.failures else 0


if __name__ == "__main__":
    sys.exit(main())
