"""pip install from the sources, into a fresh environment, away from the build tree."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

PROGRAM = """
import importlib.metadata, isobrick, numpy, os
assert importlib.metadata.version("isobrick") == isobrick.__version__
assert os.path.dirname(isobrick.__file__).startswith(os.environ["PREFIX"]), isobrick.__file__
field = isobrick.synth("sphere", shape=(20, 20, 20), dtype="f4")
mesh = isobrick.extract(field, 0)
assert len(mesh) > 100
mesh.save("a.ply")
try:
    import h5py
except ImportError:
    raise SystemExit
with h5py.File("a.h5", "w") as file:
    file["a"] = field
try:
    volume = isobrick.open("a.h5", cache=False)
except isobrick.Error as error:
    assert "built without" in str(error), error
else:
    assert numpy.array_equal(volume.read(), field)
"""


def run(*command, **options):
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    environment.update(options.pop("env", {}))
    done = subprocess.run(
        [str(word) for word in command], text=True, capture_output=True, env=environment, **options
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_pip_installs_what_runs(tmp_path):
    if "ISOBRICK_PYTHON_BUILD" not in os.environ:
        pytest.skip("ISOBRICK_PYTHON_BUILD names no build tree")
    pytest.importorskip("venv")
    pytest.importorskip("ensurepip")
    pytest.importorskip("setuptools")
    # What pip writes beside setup.py goes into a copy.
    source = tmp_path / "source"
    source.mkdir()
    for name in ("CMakeLists.txt", "LICENSE", "README.md", "pyproject.toml", "setup.py"):
        shutil.copy(ROOT / name, source)
    shutil.copytree(ROOT / "python", source / "python")
    (source / "include/isobrick").mkdir(parents=True)
    shutil.copy(ROOT / "include/isobrick/version.h", source / "include/isobrick")
    run(sys.executable, "-m", "venv", "--system-site-packages", tmp_path / "venv")
    python = tmp_path / "venv" / "bin" / "python"
    run(python, "-m", "pip", "install", "--no-build-isolation", "--no-deps", "--no-index",
        "--disable-pip-version-check", source)
    (tmp_path / "work").mkdir()
    run(python, "-c", PROGRAM, cwd=tmp_path / "work", env={"PREFIX": str(tmp_path / "venv")})
    installed = next((tmp_path / "venv").rglob("site-packages/isobrick"))
    for name in ("py.typed", "_isobrick.pyi", "napari.yaml"):
        assert (installed / name).exists(), name
    assert (tmp_path / "venv/share/isobrick/paraview/isobrick.xml").exists()
    entries = run(python, "-c", "import importlib.metadata as m; print([e.value for e in "
                  "m.distribution('isobrick').entry_points if e.group == 'napari.manifest'])",
                  cwd=tmp_path / "work")
    assert "isobrick:napari.yaml" in entries
