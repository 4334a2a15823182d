"""The rooms stand at the top level of the repository and are installed as parts of one package: app/ as handscope.app, and so on.

With HANDSCOPE_TRANSLATED=1 the wheel brings the estimators' machine code for this platform and Python (`make dist`; needs all that they import).
"""

import os
import platform
import shutil
import subprocess
import sys
from pathlib import Path

from setuptools import Distribution, find_namespace_packages, setup
from setuptools.command.build_py import build_py

ROOMS = ("app", "estimators", "sessions", "static", "validation")
FOUND = find_namespace_packages(
    include=[pattern for room in ROOMS for pattern in (room, f"{room}.*")]
)
IS_TRANSLATED = os.environ.get("HANDSCOPE_TRANSLATED") == "1"
TRANSLATES = (sys.executable, "-P", "-m", "handscope.app.compile_kernels", "--into")
# LLVM's name of a class, and what its processors can do: Intel's and AMD's of 2013 and later
V3 = "+avx,+avx2,+bmi,+bmi2,+cx16,+f16c,+fma,+lzcnt,+movbe,+popcnt,+sahf,+sse3,+sse4.1,+sse4.2,+ssse3,+xsave"
CLASSES = {"x86_64": ("x86-64-v3", V3), "AMD64": ("x86-64-v3", V3)}


class Translated(build_py):
    """Modules, and the machine code of their kernels."""

    def run(self) -> None:
        """Copy the modules, then translate the copy."""
        super().run()
        if not IS_TRANSLATED:
            return
        package = Path(self.build_lib, "handscope").resolve()
        shutil.rmtree(package / "machine_code", ignore_errors=True)
        processor, features = CLASSES.get(platform.machine(), ("generic", ""))
        own = {
            "PYTHONPATH": str(package.parent),
            "PYTHONDONTWRITEBYTECODE": "1",
            "NUMBA_CPU_NAME": processor,
            "NUMBA_CPU_FEATURES": features,
        }
        subprocess.run([*TRANSLATES, str(package)], check=True, env={**os.environ, **own})
        for folder in package.rglob("__pycache__"):
            shutil.rmtree(folder)


class Platform(Distribution):
    """A wheel for one platform and Python where it brings machine code."""

    def has_ext_modules(self) -> bool:
        """Whether it does."""
        return IS_TRANSLATED


setup(
    packages=["handscope", *(f"handscope.{name}" for name in FOUND)],
    package_dir={f"handscope.{room}": room for room in ROOMS},
    cmdclass={"build_py": Translated},
    distclass=Platform,
)
