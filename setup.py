"""The rooms stand at the top level of the repository and are installed as parts of one package: app/ as handscope.app, and so on."""

from setuptools import find_namespace_packages, setup

ROOMS = ("app", "estimators", "sessions", "static", "validation")
FOUND = find_namespace_packages(
    include=[pattern for room in ROOMS for pattern in (room, f"{room}.*")]
)

setup(
    packages=["handscope", *(f"handscope.{name}" for name in FOUND)],
    package_dir={f"handscope.{room}": room for room in ROOMS},
)
