"""Packages that only some formats need: asked for where they are needed, with the words that install them."""

from importlib import import_module
from typing import Any

from handscope.estimators.errors import InputError


def require(module: str, extra: str) -> Any:
    """The module; InputError with what to install where it is not there."""
    try:
        return import_module(module)
    except ImportError:
        raise InputError(
            f'this needs the package {module.split(".")[0]}; install it by: pip install "handscope[{extra}]"'
        ) from None
