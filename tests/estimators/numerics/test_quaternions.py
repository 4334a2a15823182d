"""Group laws, inverses and references over batch shapes, and that a row's bits never depend on its
neighbours."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from handscope.estimators.numerics import quaternions as quat

SHAPES = [(), (1,), (3, 1, 2, 1)]
EDGES = [
    0.0,
    1e-300,
    1e-12,
    0.9e-8,
    1.1e-8,
    1e-5,
    1.5e-3,
    np.pi / 2,
    np.pi - 1e-9,
    np.pi,
    np.pi + 1e-9,
    2 * np.pi - 1e-9,
]
ROUNDING = 1e-14


@st.composite
def rotation_vectors(draw: st.DrawFn, shape: tuple[int, ...] | None = None) -> np.ndarray:
    shape = draw(st.sampled_from(SHAPES)) if shape is None else shape
    axis = draw(arrays(float, (*shape, 3), elements=st.floats(-1, 1))) + [1e-3, 0, 0]
    norm = np.linalg.norm(axis, axis=-1, keepdims=True)
    axis = np.where(norm > 1e-6, axis / np.maximum(norm, 1e-6), [0, 0, 1.0])
    return axis * draw(
        arrays(float, (*shape, 1), elements=st.sampled_from(EDGES) | st.floats(0, 2 * np.pi))
    )


@st.composite
def rotations(draw: st.DrawFn, count: int) -> tuple[np.ndarray, ...]:
    """Unit quaternions of one shape, near identity and near half turns among them."""
    shape = draw(st.sampled_from(SHAPES))
    return tuple(quat.exp(draw(rotation_vectors(shape))) for _ in range(count))


def assert_same_rotation(q: np.ndarray, p: np.ndarray, atol: float = ROUNDING) -> None:
    np.testing.assert_allclose(q * np.sign((q * p).sum(axis=-1, keepdims=True)), p, atol=atol)


@given(rotations(3))
def test_rotations_form_a_group(q: tuple[np.ndarray, ...]) -> None:
    a, b, c = q
    identity = np.broadcast_to(quat.IDENTITY, a.shape)
    np.testing.assert_allclose(
        quat.multiply(quat.multiply(a, b), c), quat.multiply(a, quat.multiply(b, c)), atol=ROUNDING
    )
    np.testing.assert_array_equal(quat.multiply(a, identity), a)
    np.testing.assert_array_equal(quat.multiply(identity, a), a)
    np.testing.assert_allclose(quat.multiply(a, quat.conjugate(a)), identity, atol=ROUNDING)
    np.testing.assert_allclose(quat.relative(a, quat.multiply(a, b)), b, atol=ROUNDING)


@given(rotations(2), st.tuples(*3 * [st.floats(-10, 10)]))
def test_rotating_twice_is_rotating_by_the_product(
    q: tuple[np.ndarray, ...], v: tuple[float, ...]
) -> None:
    a, b = q
    v_c = np.broadcast_to(np.array(v), (*a.shape[:-1], 3))
    turned = quat.rotate(quat.multiply(a, b), v_c)
    np.testing.assert_allclose(turned, quat.rotate(a, quat.rotate(b, v_c)), atol=1e-13)
    np.testing.assert_allclose(
        np.linalg.norm(turned, axis=-1), np.linalg.norm(v_c, axis=-1), atol=1e-13
    )
    np.testing.assert_allclose(quat.rotate(quat.conjugate(a), quat.rotate(a, v_c)), v_c, atol=1e-13)


@given(rotation_vectors())
def test_log_undoes_exp_the_shorter_way_round(rotvec: np.ndarray) -> None:
    q = quat.exp(rotvec)
    np.testing.assert_allclose(np.linalg.norm(q, axis=-1), 1.0, atol=ROUNDING)
    back = quat.log(q)
    assert (np.linalg.norm(back, axis=-1) <= np.pi + ROUNDING).all()
    assert_same_rotation(quat.exp(back), q)
    # 1e-9: log's first order below 1e-10
    np.testing.assert_allclose(quat.angle(q), np.linalg.norm(back, axis=-1), atol=1e-9)
    short = np.linalg.norm(rotvec, axis=-1) < np.pi - 1e-6
    np.testing.assert_allclose(back[short], rotvec[short], atol=1e-14)


@pytest.mark.parametrize("angle", [e for e in EDGES if e < np.pi])
def test_log_undoes_exp_at_every_edge(angle: float) -> None:
    rotvec = angle * np.array([0.6, 0.0, -0.8])
    np.testing.assert_allclose(quat.log(quat.exp(rotvec)), rotvec, rtol=1e-14)


def test_log_of_minus_identity_is_no_rotation() -> None:
    np.testing.assert_array_equal(quat.log(-quat.IDENTITY), 0.0)
    np.testing.assert_allclose(
        quat.log(-quat.exp(np.array([1e-12, 0, 0]))), [1e-12, 0, 0], rtol=1e-12
    )


@given(rotations(2))
def test_matrices_agree_with_quaternions(q: tuple[np.ndarray, ...]) -> None:
    a, b = q
    R = quat.matrix(a)
    assert R.shape == (*a.shape[:-1], 3, 3)
    np.testing.assert_allclose(
        R @ np.swapaxes(R, -1, -2), np.broadcast_to(np.eye(3), R.shape), atol=1e-14
    )
    np.testing.assert_allclose(quat.matrix(quat.multiply(a, b)), R @ quat.matrix(b), atol=1e-14)
    np.testing.assert_allclose(
        (R @ np.array([1.0, -2.0, 3.0])),
        quat.rotate(a, np.broadcast_to([1.0, -2.0, 3.0], R.shape[:-1])),
        atol=1e-13,
    )
    back = quat.from_matrix(R)
    assert back.shape == a.shape
    assert (back[..., 0] >= 0).all()
    assert_same_rotation(back, a)


@given(rotations(2))
def test_products_and_matrices_agree_with_scipy(q: tuple[np.ndarray, ...]) -> None:
    a, b = (p.reshape(-1, 4) for p in q)
    reference = Rotation.from_quat(a, scalar_first=True) * Rotation.from_quat(b, scalar_first=True)
    assert_same_rotation(reference.as_quat(scalar_first=True), quat.multiply(a, b))
    np.testing.assert_allclose(reference.as_matrix(), quat.matrix(quat.multiply(a, b)), atol=1e-14)


@given(st.integers(0, 2), st.floats(-10, 10), st.floats(-1.5, 1.5))
def test_a_twist_is_the_turn_about_the_axis(axis: int, theta: float, swing: float) -> None:
    q = quat.multiply(quat.about(axis, theta), quat.about((axis + 1) % 3, swing))
    difference = (quat.twist(q, axis) - theta + np.pi) % (2 * np.pi) - np.pi
    assert abs(difference) < 1e-9
    assert -np.pi <= quat.twist(q, axis) < np.pi
    np.testing.assert_allclose(
        quat.about(axis, theta), quat.exp(theta * np.eye(3)[axis]), atol=ROUNDING
    )


@given(rotations(1), st.floats(-7, 7))
def test_headed_turns_about_the_vertical(q: tuple[np.ndarray, ...], theta: float) -> None:
    np.testing.assert_allclose(
        quat.turn_heading(q[0], theta), quat.multiply(quat.about(2, theta), q[0]), atol=ROUNDING
    )


@given(rotations(2))
def test_slerp_begins_exactly_and_ends_up_to_rounding(q: tuple[np.ndarray, ...]) -> None:
    a, b = q
    weight = np.zeros(a.shape[:-1])
    np.testing.assert_array_equal(quat.slerp(a, b, weight), a)
    np.testing.assert_array_equal(quat.slerp(a, b * np.nan, weight), a)
    assert_same_rotation(quat.slerp(a, b, weight + 1.0), b)
    middle = quat.slerp(a, b, weight + 0.5)
    np.testing.assert_allclose(
        quat.angle(quat.relative(a, middle)), 0.5 * quat.angle(quat.relative(a, b)), atol=1e-7
    )


@given(rotations(1), st.floats(0, 0.5))
def test_the_mean_lies_in_the_middle_whatever_the_signs(
    q: tuple[np.ndarray, ...], spread: float
) -> None:
    centre = q[0].reshape(-1, 4)[0]
    d = np.array([[spread, 0, 0], [-spread, 0, 0], [0, 0, spread], [0, 0, -spread]])
    around = quat.multiply(np.tile(centre, (4, 1)), quat.exp(d)) * np.array([[1], [-1], [-1], [1]])
    assert_same_rotation(quat.mean(around), centre, atol=1e-12)
    assert quat.mean(around)[0] >= 0


def test_cross_products_are_numpys_to_the_bit(rng: np.random.Generator) -> None:
    u, v = rng.normal(size=(20, 3, 3)), rng.normal(size=(3, 3))
    np.testing.assert_array_equal(quat.cross(u, v), np.cross(u, v))


def test_skew_is_the_cross_product(rng: np.random.Generator) -> None:
    u, v = rng.normal(size=(2, 5, 3))
    np.testing.assert_allclose((quat.skew(u) @ v[..., None])[..., 0], np.cross(u, v), atol=1e-15)


def test_normalize_gives_unit_length_in_the_same_direction(rng: np.random.Generator) -> None:
    q = 1e3 * rng.normal(size=(7, 4))
    np.testing.assert_allclose(
        quat.normalize(q) * np.linalg.norm(q, axis=-1, keepdims=True), q, rtol=1e-15
    )


def _functions() -> dict[str, Callable[[np.ndarray, np.ndarray], np.ndarray]]:
    """Each on rows of two quaternions (n, 4)."""
    return {
        "multiply": quat.multiply,
        "conjugate": lambda a, b: quat.conjugate(a),
        "relative": quat.relative,
        "rotate": lambda a, b: quat.rotate(a, b[:, 1:]),
        "normalize": lambda a, b: quat.normalize(a + 0.1 * b),
        "exp": lambda a, b: quat.exp(a[:, 1:]),
        "log": lambda a, b: quat.log(a),
        "angle": lambda a, b: quat.angle(a),
        "about": lambda a, b: quat.about(1, a[:, 0] * 3),
        "headed": lambda a, b: quat.turn_heading(a, b[:, 0]),
        "twist": lambda a, b: quat.twist(a, 2),
        "slerp": lambda a, b: quat.slerp(a, b, np.abs(a[:, 0])),
        "matrix": lambda a, b: quat.matrix(a),
        "from_matrix": lambda a, b: quat.from_matrix(quat.matrix(a)),
        "skew": lambda a, b: quat.skew(a[:, 1:]),
    }


@pytest.mark.parametrize("name", _functions())
def test_a_row_never_depends_on_its_neighbours(name: str, rng: np.random.Generator) -> None:
    function = _functions()[name]
    a, b = quat.normalize(rng.normal(size=(2, 1001, 4)))
    whole = function(a, b)
    for size in (1, 2, 3, 5, 7, 8, 9, 15, 17, 33, 1000):
        pieces = [function(a[k : k + size], b[k : k + size]) for k in range(0, 1001, size)]
        np.testing.assert_array_equal(np.concatenate(pieces), whole, err_msg=f"in pieces of {size}")
    strided = function(np.repeat(a, 3, axis=0)[::3], np.asfortranarray(b))
    np.testing.assert_array_equal(strided, whole, err_msg="not contiguous in memory")
