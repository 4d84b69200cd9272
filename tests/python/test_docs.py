"""The guide's examples run, everything public is described, and the stubs name what there is."""

import ast
import doctest
import inspect
from pathlib import Path

import pytest

import isobrick
import isobrick._isobrick
from conftest import can_draw

ROOT = Path(__file__).resolve().parents[2]


def blocks_of(page):
    """The blocks of Python of a page, each with the lines before it, so that tracebacks fit."""
    lines = page.read_text().splitlines()
    begin = None
    for number, line in enumerate(lines):
        if line == "```python":
            begin = number + 1
        elif line == "```" and begin is not None:
            yield "\n" * begin + "\n".join(lines[begin:number])
            begin = None


def test_the_examples_of_the_guide_run(tmp_path, monkeypatch):
    page = ROOT / "docs/guide/python.md"
    monkeypatch.chdir(tmp_path)
    namespace = {}
    count = 0
    for block in blocks_of(page):
        if "# with a GPU" in block or ("# with OpenGL" in block and not can_draw()):
            continue
        exec(compile(block, str(page), "exec"), namespace)
        count += 1
    assert count >= 7
    assert len(namespace["mesh"]) > 100 and len(namespace["surface"]) > 100
    assert namespace["stages"]
    for name in ("ball.ply", "large.stl", "gyroid.ply", "corner.nrrd"):
        assert (tmp_path / name).stat().st_size > 1000


def test_docstrings_run():
    result = doctest.testmod(isobrick)
    assert result.attempted > 0 and result.failed == 0


def members_of(thing):
    return {
        name: value
        for name, value in vars(thing).items()
        if not name.startswith("_") and (callable(value) or isinstance(value, property))
    }


def test_everything_public_is_described():
    assert "z, y, x" in isobrick.__doc__
    for name in isobrick.__all__:
        thing = getattr(isobrick, name)
        if name == "__version__":
            continue
        assert inspect.getdoc(thing), name
        if inspect.isclass(thing):
            for member, value in members_of(thing).items():
                assert inspect.getdoc(value), f"{name}.{member}"


def stub(name):
    return ast.parse((ROOT / "python/isobrick" / name).read_text()).body


def parameters(function):
    found = function.args
    extra = [found.kwarg.arg] if found.kwarg else []
    return [a.arg for a in found.posonlyargs + found.args + found.kwonlyargs] + extra


def test_stubs_have_the_signatures_of_the_package():
    found = {node.name: node for node in stub("__init__.pyi") if hasattr(node, "name")}
    assert set(isobrick.__all__) == set(found) | {"__version__"}
    for name, node in found.items():
        thing = getattr(isobrick, name)
        if isinstance(node, ast.FunctionDef):
            assert parameters(node) == list(inspect.signature(thing).parameters), name
            continue
        described = {n.name: n for n in node.body if isinstance(n, ast.FunctionDef)}
        assert set(members_of(thing)) == {n for n in described if not n.startswith("_")}, name
        for member, function in described.items():
            value = getattr(thing, member)
            if callable(value):
                assert parameters(function) == list(inspect.signature(value).parameters), member


@pytest.mark.parametrize("name", ["_isobrick", "_render"])
def test_stubs_of_the_modules_name_what_there_is(name):
    module = pytest.importorskip(f"isobrick.{name}")
    named = {}
    for node in stub(f"{name}.pyi"):
        if isinstance(node, ast.ClassDef):
            named[node.name] = {
                child.target.id if isinstance(child, ast.AnnAssign) else child.name
                for child in node.body
                if not isinstance(child, ast.Expr)
            }
        elif isinstance(node, ast.FunctionDef):
            named[node.name] = None
    there = {name for name in dir(module) if not name.startswith("_")}
    assert there == set(named)
    for name, members in named.items():
        if members is None:
            continue
        real = {m for m in vars(getattr(module, name)) if not m.startswith("_")}
        if name in ("Backend", "Inside", "Topology"):
            real -= {"name", "value", "auto"}
        assert members - {"__init__"} == real, name
