"""Colours of vertices by an attribute: Mesh.save and Volume.save_mesh."""

import json
import struct

import numpy as np
import pytest

import isobrick


def colours_of(path):
    """Colours (N, 3) uint8 of the vertices of a PLY."""
    content = path.read_bytes()
    head, body = content.split(b"end_header\n", 1)
    lines = head.decode().splitlines()
    count = next(int(line.split()[2]) for line in lines if line.startswith("element vertex"))
    kinds = {"float": "<f4", "uchar": "u1"}
    fields = []
    for line in lines[lines.index(f"element vertex {count}") + 1:]:
        if not line.startswith("property"):
            break
        fields.append((line.split()[2], kinds[line.split()[1]]))
    rows = np.frombuffer(body, fields, count)
    return np.stack([rows[name] for name in ("red", "green", "blue")], axis=1)


VIRIDIS = (68, 1, 84), (253, 231, 37)  # its ends


def test_reach_over_the_values_of_a_mesh(ball_and_ramp, tmp_path):
    ball, ramp = ball_and_ramp
    mesh = ball.extract(9.5, attributes={"ramp": ramp})
    values = mesh.attributes["ramp"]
    values[3] = np.nan
    mesh.save(tmp_path / "a.ply", colour_by="ramp")
    colours = colours_of(tmp_path / "a.ply")
    assert tuple(colours[np.nanargmin(values)]) == VIRIDIS[0]
    assert tuple(colours[np.nanargmax(values)]) == VIRIDIS[1]
    assert len(set(colours[3])) == 1  # grey
    ends = float(np.nanmin(values)), float(np.nanmax(values))
    mesh.save(tmp_path / "b.ply", colour_by=("ramp", *ends), colour_map="viridis")
    assert (tmp_path / "b.ply").read_bytes() == (tmp_path / "a.ply").read_bytes()
    # The other way around, and another scale.
    mesh.save(tmp_path / "c.ply", colour_by=["ramp", ends[1], ends[0]])
    assert tuple(colours_of(tmp_path / "c.ply")[np.nanargmin(values)]) == VIRIDIS[1]
    mesh.save(tmp_path / "d.ply", colour_by=("ramp", 0, 1e9), colour_map="grey")
    greys = np.delete(colours_of(tmp_path / "d.ply"), 3, axis=0)
    assert len(np.unique(greys, axis=0)) == 1 and len(set(greys[0])) == 1


@pytest.mark.parametrize("extension", ["ply", "glb"])
def test_a_stream_reaches_over_the_volume(ball_and_ramp, tmp_path, extension):
    ball, ramp = ball_and_ramp
    others = {"ramp": ramp}
    a, b = tmp_path / f"a.{extension}", tmp_path / f"b.{extension}"
    ball.save_mesh(a, 9.5, attributes=others, colour_by="ramp", colour_map="coolwarm")
    mesh = ball.extract(9.5, attributes=others)
    mesh.save(b, colour_by=("ramp", 0, 19), colour_map="coolwarm")
    assert a.read_bytes() == b.read_bytes()
    mesh.save(b, force=True)
    assert a.read_bytes() != b.read_bytes()


def test_a_glb_has_them_beside_the_attribute(ball_and_ramp, tmp_path):
    ball, ramp = ball_and_ramp
    ball.save_mesh(tmp_path / "a.glb", 9.5, attributes={"ramp": ramp}, colour_by="ramp")
    content = (tmp_path / "a.glb").read_bytes()
    scene = json.loads(content[20:20 + struct.unpack("<I", content[12:16])[0]])
    attributes = scene["meshes"][0]["primitives"][0]["attributes"]
    assert set(attributes) == {"POSITION", "_RAMP", "COLOR_0"}


def test_what_makes_no_sense_is_refused(ball_and_ramp, tmp_path):
    ball, ramp = ball_and_ramp
    mesh = ball.extract(9.5, attributes={"ramp": ramp, "Itself": ball})
    mesh.attributes["flat"] = np.full(len(mesh.vertices), 7)
    mesh.attributes["unknown"] = np.full(len(mesh.vertices), np.nan)
    for words, match in (
        ({"colour_by": "heat"}, "no attribute 'heat'"),
        ({"colour_by": ("heat", 0, 1)}, "no attribute 'heat'"),
        ({"colour_by": ("ramp", 0)}, "name, low, high"),
        ({"colour_by": 3}, "name, low, high"),
        ({"colour_by": "flat"}, "single value"),
        ({"colour_by": "unknown"}, "not known"),
        ({"colour_by": ("ramp", 2, 2)}, "two values"),
        ({"colour_by": ("ramp", 0, float("inf"))}, "two values"),
        ({"colour_by": "ramp", "colour_map": "jet"}, "jet"),
        ({"colour_map": "grey"}, "colour_by"),
    ):
        with pytest.raises(isobrick.UsageError, match=match):
            mesh.save(tmp_path / "m.ply", **words)
    with pytest.raises(isobrick.UsageError, match="GLB and PLY"):
        mesh.save(tmp_path / "m.vtp", colour_by="ramp")
    with pytest.raises(isobrick.UsageError, match="GLB and PLY"):
        ball.save_mesh(tmp_path / "m.pvtp", 9.5, attributes={"ramp": ramp}, colour_by="ramp")
    with pytest.raises(isobrick.UsageError, match="no attribute"):
        ball.save_mesh(tmp_path / "m.ply", 9.5, colour_by="ramp")
    assert not list(tmp_path.glob("m.*"))
