"""BLAS while numerics work in threads of their own."""

from threadpoolctl import threadpool_info, threadpool_limits

from handscope.estimators.numerics.native_libraries import single_threaded_blas


def threads() -> set[int]:
    return {p["num_threads"] for p in threadpool_info() if p["user_api"] == "blas"}


def test_blas_has_one_thread_meanwhile_and_its_own_number_afterwards() -> None:
    with threadpool_limits(2, user_api="blas"):
        before = threads()  # of some libraries none is to be had but the number that make set
        with single_threaded_blas():
            assert threads() == {1}
        assert threads() == before
    assert 2 in before
