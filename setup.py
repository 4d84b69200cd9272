"""Builds the Python package: pip install --no-build-isolation .

CMake builds the module in C++, in a folder of its own. ISOBRICK_PYTHON_BUILD names a build tree that
exists already, which is used as it is. ISOBRICK_CMAKE_ARGS are further options of CMake.
"""

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

ROOT = Path(__file__).resolve().parent


def version():
    header = (ROOT / "include/isobrick/version.h").read_text()
    return ".".join(re.findall(r"define ISOBRICK_VERSION_(?:MAJOR|MINOR|PATCH) (\d+)", header))


class CMakeBuild(build_ext):
    def build_extension(self, extension):
        build = os.environ.get("ISOBRICK_PYTHON_BUILD")
        if build is None:
            build = Path(self.build_temp).resolve() / "cmake"
            self.configure(build)
        subprocess.check_call(["cmake", "--build", str(build), "--target", "isobrick_python",
                               "-j", str(self.parallel or os.cpu_count() or 1)])
        package = Path(self.get_ext_fullpath(extension.name)).resolve().parent
        package.mkdir(parents=True, exist_ok=True)
        built = Path(build) / "python" / "isobrick"
        for module in (*built.glob("_isobrick*.so"), *built.glob("_render*.so")):
            shutil.copy2(module, package)
        # The libraries of formats, which are loaded when they are needed.
        (package / "modules").mkdir(exist_ok=True)
        for module in (built / "modules").glob("isobrick_*"):
            shutil.copy2(module, package / "modules")

    @staticmethod
    def configure(build):
        options = ["-DISOBRICK_PYTHON=ON", "-DISOBRICK_BUILD_TESTS=OFF", "-DISOBRICK_BUILD_TOOLS=OFF",
                   "-DCMAKE_BUILD_TYPE=Release", "-DCMAKE_UNITY_BUILD=ON"]
        generator = ["-G", "Ninja"] if shutil.which("ninja") else []
        subprocess.check_call(["cmake", "-S", str(ROOT), "-B", str(build), *generator, *options,
                               f"-DPython3_EXECUTABLE={sys.executable}",
                               *shlex.split(os.environ.get("ISOBRICK_CMAKE_ARGS", ""))])


setup(
    version=version(),
    packages=["isobrick"],
    package_dir={"": "python"},
    package_data={"isobrick": ["py.typed", "*.pyi", "napari.yaml"]},
    data_files=[("share/isobrick/paraview", ["python/paraview/isobrick.xml"])],
    ext_modules=[Extension("isobrick._isobrick", [])],
    cmdclass={"build_ext": CMakeBuild},
)
