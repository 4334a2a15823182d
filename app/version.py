"""The installed version of Handscope."""

from importlib.metadata import PackageNotFoundError, version


def software_version() -> str:
    """The version that results are stored under."""
    try:
        return version("handscope")
    except PackageNotFoundError:
        return "0+unpackaged"
