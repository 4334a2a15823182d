"""Packages that numba would import although nothing here needs them."""

import subprocess
import sys
from pathlib import Path

import pytest
from numba.core.typing import cffi_utils

from handscope.estimators.numerics import jit
from handscope.estimators.numerics.optional_imports import hidden, import_without_package


def test_a_hidden_package_can_be_imported_afterwards(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a_parser_of_c.py").write_text("")
    monkeypatch.syspath_prepend(str(tmp_path))
    with hidden("a_parser_of_c"), pytest.raises(ModuleNotFoundError):
        import a_parser_of_c  # type: ignore[import-not-found]
    import a_parser_of_c

    with hidden("a_parser_of_c"):  # in use already: it stays
        assert sys.modules["a_parser_of_c"] is a_parser_of_c
    assert sys.modules.pop("a_parser_of_c") is a_parser_of_c


def test_a_module_is_imported_without_its_package_which_can_be_imported_afterwards(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = tmp_path / "a_large_package"
    package.mkdir()
    (package / "__init__.py").write_text("carried_out = True\n")
    (package / "small.py").write_text("value = 1\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    import_without_package("a_large_package", "small")
    small = sys.modules["a_large_package.small"]
    assert "a_large_package" not in sys.modules
    import a_large_package  # type: ignore[import-not-found]
    from a_large_package import small as again  # type: ignore[import-not-found]

    assert a_large_package.carried_out and again is small
    import_without_package("a_large_package", "nothing")  # in use already: it stays
    assert sys.modules.pop("a_large_package") is a_large_package
    del sys.modules["a_large_package.small"]


def test_lapack_is_called_without_the_rest_of_scipys_linear_algebra() -> None:
    script = """
import sys, numpy as np
from handscope.estimators.numerics.jit import njit
singular = njit(lambda a: np.linalg.svd(a)[1])(np.diag([3.0, 4.0]))
assert singular.tolist() == [4.0, 3.0] and "scipy.linalg" not in sys.modules
import scipy.linalg
assert scipy.linalg.svdvals(np.diag([3.0, 4.0])).tolist() == [4.0, 3.0]
"""
    subprocess.run([sys.executable, "-P", "-c", script], check=True)


def test_kernels_are_loaded_without_a_parser_of_c() -> None:
    assert jit.njit is not None
    assert not cffi_utils.SUPPORTED
