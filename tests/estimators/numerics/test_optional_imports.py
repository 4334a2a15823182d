"""Packages that numba would import although nothing here needs them."""

import sys
from pathlib import Path

import pytest
from numba.core.typing import cffi_utils

from handscope.estimators.numerics import jit
from handscope.estimators.numerics.optional_imports import hidden


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


def test_kernels_are_loaded_without_a_parser_of_c() -> None:
    assert jit.njit is not None
    assert not cffi_utils.SUPPORTED
