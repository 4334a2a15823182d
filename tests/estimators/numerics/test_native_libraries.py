"""BLAS and the C library while numerics work in threads of their own."""

import ctypes
import os
import platform
import subprocess
import sys
from unittest import mock

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from handscope.estimators.numerics.native_libraries import (
    MAPPED,
    large_arrays_given_back,
    single_threaded_blas,
)

HELD = f"""
import contextlib, numpy as np
from pathlib import Path
from handscope.estimators.numerics.native_libraries import large_arrays_given_back
def resident():
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096
np.ones(2 * {MAPPED} - 1000)  # glibc maps none so small any more
with {{block}}:
    before = resident()
    large, above = np.ones({MAPPED}), [np.ones(100) for _ in range(100)]
    del large
    print(resident() - before)
"""


def threads() -> set[int]:
    return {p["num_threads"] for p in threadpool_info() if p["user_api"] == "blas"}


def test_blas_has_one_thread_meanwhile_and_its_own_number_afterwards() -> None:
    with threadpool_limits(2, user_api="blas"):
        before = threads()  # of some libraries none is to be had but the number that make set
        with single_threaded_blas():
            assert threads() == {1}
        assert threads() == before
    assert 2 in before


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only glibc can be asked")
def test_a_large_array_is_given_back_though_small_ones_lie_above_it() -> None:
    def held(block: str) -> int:
        command = [sys.executable, "-P", "-c", HELD.format(block=block)]
        # Dask, which other tests start, sets one of glibc's for all that come after
        plain = {name: value for name, value in os.environ.items() if "MALLOC" not in name}
        return int(subprocess.run(command, check=True, capture_output=True, env=plain).stdout)

    assert held("contextlib.nullcontext()") > MAPPED
    assert held("large_arrays_given_back()") < MAPPED / 4


def test_without_glibc_the_work_is_done_all_the_same() -> None:
    with mock.patch.object(ctypes, "CDLL", side_effect=TypeError), large_arrays_given_back():
        assert np.ones(3).sum() == 3
