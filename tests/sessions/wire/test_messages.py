"""Every message to bytes and back, and bytes that make no message."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handscope.estimators.data.magnet_declaration import Plate
from handscope.estimators.data.samples import ACC, GYR, TRACKED_POINTS
from handscope.sessions.wire import messages as wire
from handscope.sessions.wire.force_calibration import ForceSensorCalibration
from handscope.sessions.wire.messages import BadPayloadError, Format, Message, decode, encode
from handscope.sessions.wire.sample_values import decode_values, encode_values, has_expected_size

BYTE, SHORT, LONG = st.integers(0, 2**8 - 1), st.integers(0, 2**32 - 1), st.integers(0, 2**64 - 1)
REAL = st.floats(width=32, allow_nan=False, allow_infinity=False)
TEXT = st.text(max_size=60)
PAIRS = st.dictionaries(TEXT, TEXT, max_size=4)


def reals(many: int) -> st.SearchStrategy[tuple[float, ...]]:
    """Named shortly: a rejected number names all strategies, and beyond 30 kB that is a warning, and so a failure."""
    return st.lists(REAL, min_size=many, max_size=many).map(tuple)


@st.composite
def strips(draw: st.DrawFn) -> wire.Strip:
    points = tuple(draw(st.lists(st.sampled_from(TRACKED_POINTS), max_size=4)))
    turned = np.random.default_rng(draw(SHORT)).normal(size=(len(points), 4))
    mounting = (turned / np.linalg.norm(turned, axis=1, keepdims=True)).astype("<f4").ravel()
    return wire.Strip(
        draw(BYTE),
        draw(st.booleans()),
        draw(LONG),
        points,
        tuple(map(float, mounting)) if draw(st.booleans()) else (),
        draw(st.booleans()),
    )


@st.composite
def stream_infos(draw: st.DrawFn) -> wire.StreamInfo:
    *others, orientation = wire.QUANTITIES  # which comes alone
    quantities = tuple(q for q in others if draw(st.booleans())) or (orientation,)
    numbers = [tuple(draw(REAL) for _ in quantities) for _ in range(2)]
    rate = draw(st.floats(0.01, 10_000))
    return wire.StreamInfo(
        draw(BYTE),
        draw(BYTE),
        draw(BYTE),
        quantities,
        draw(st.sampled_from(Format)),
        rate,
        numbers[0],
        numbers[1],
    )


def force_told(axes: int) -> st.SearchStrategy[ForceSensorCalibration]:
    share = st.floats(0, 0.5, width=32)
    return st.builds(
        ForceSensorCalibration,
        BYTE,
        BYTE,
        share,
        st.none() | share,
        reals(axes),
        reals(axes * axes),
    )


CALIBRATIONS = st.builds(wire.StripCalibration, BYTE, BYTE, reals(9), reals(27))
THREE = st.tuples(REAL, REAL, REAL)
PLATES = st.builds(
    Plate,
    st.dictionaries(st.sampled_from(TRACKED_POINTS), THREE, max_size=4),
    THREE,
    THREE,
    REAL,
    st.none() | REAL,
)
MESSAGES: dict[type, st.SearchStrategy[Message]] = {
    wire.Identity: st.builds(
        wire.Identity,
        LONG,
        SHORT,
        st.sampled_from([None, "left", "right"]),
        TEXT,
        TEXT,
        st.integers(0, 65535),
    ),
    wire.Strip: strips(),
    wire.StreamInfo: stream_infos(),
    wire.Samples: st.builds(wire.Samples, BYTE, SHORT, LONG, LONG, BYTE, st.binary(max_size=100)),
    wire.Status: st.builds(wire.Status, LONG, SHORT, BYTE, REAL),
    wire.Reply: st.builds(wire.Reply, BYTE, st.sampled_from(wire.ReplyCode), TEXT),
    wire.Pong: st.builds(wire.Pong, LONG, LONG),
    wire.Mark: st.builds(wire.Mark, LONG, LONG, TEXT, PAIRS),
    wire.StripCalibration: CALIBRATIONS,
    Plate: PLATES,
    ForceSensorCalibration: st.sampled_from([3, 6]).flatmap(force_told),
    wire.Identify: st.just(wire.Identify()),
    wire.Configure: st.builds(
        wire.Configure,
        BYTE,
        st.floats(0, 1000),
        st.floats(0, 100),
        REAL,
        REAL,
        st.sampled_from(Format),
    ),
    wire.Start: st.just(wire.Start()),
    wire.Stop: st.just(wire.Stop()),
    wire.Ping: st.builds(wire.Ping, LONG),
    wire.Cue: st.builds(wire.Cue, TEXT, PAIRS),
    wire.ReadCalibration: st.builds(wire.ReadCalibration, BYTE),
    wire.WriteCalibration: CALIBRATIONS.map(wire.WriteCalibration),
}
ANY = st.one_of(*MESSAGES.values())


@pytest.mark.parametrize("kind", MESSAGES, ids=lambda kind: kind.__name__)
@given(data=st.data())
def test_every_message_comes_back_from_its_bytes(kind: type, data: st.DataObject) -> None:
    message = data.draw(MESSAGES[kind])
    assert decode(*encode(message)) == message


def test_every_message_of_the_protocol_is_tried() -> None:
    assert set(MESSAGES) == set(Message.__args__)


@given(ANY, st.data())
def test_a_payload_cut_short_is_refused_or_still_a_message(
    message: Message, data: st.DataObject
) -> None:
    code, payload = encode(message)
    cut = payload[: data.draw(st.integers(0, len(payload)))]
    try:
        assert type(decode(code, cut)) is type(message)
    except BadPayloadError:
        pass


@given(st.integers(0, 255), st.binary(max_size=80))
def test_no_bytes_make_decode_fail_otherwise(code: int, payload: bytes) -> None:
    try:
        decode(code, payload)
    except BadPayloadError:
        pass


@pytest.mark.parametrize(
    ("code", "payload"),
    [
        (0x42, b""),
        (0x01, b"\x01\x00" + bytes(12) + b"\x03\x00\x00"),  # a third hand
        (0x02, bytes(10) + b"\x03\x00\x01"),  # three sensors announced, two named
        (0x02, bytes(10) + b"\x01\x00" + bytes(16)),  # a mounting of zeros
        (0x02, bytes(10) + b"\x01\xff"),  # no such point
        (0x03, b"\x01\x01\x00\x03\x00" + np.float64(0).tobytes() + bytes(16)),  # a rate of 0
        (0x03, b"\x01\x01\x00\x03\x00" + np.float64("nan").tobytes() + bytes(16)),
        (0x03, b"\x01\x01\x00\x00\x00" + np.float64(100).tobytes()),  # no quantity
        (
            0x03,
            b"\x01\x01\x00\x23\x00" + np.float64(100).tobytes() + bytes(40),
        ),  # a quantity that this version does not know
        (
            0x03,
            b"\x01\x01\x00\x01\x00"
            + np.float64(100).tobytes()
            + np.array([np.inf, 1], "<f4").tobytes(),
        ),
        (0x03, b"\x01\x01\x00\x01\x07" + np.float64(100).tobytes() + bytes(8)),  # no such format
        (0x06, b"\x81\x00\x05abc"),  # text that runs past the end
        (0x06, b"\x81\x00\x02\xff\xfe"),  # text that is no UTF-8
    ],
)
def test_nonsense_is_refused(code: int, payload: bytes) -> None:
    with pytest.raises(BadPayloadError):
        decode(code, payload)


def test_a_long_text_is_cut_between_letters() -> None:
    for text, kept in (
        ("a" + "ü" * 200, "a" + "ü" * 127),
        ("ü" * 200, "ü" * 127),
        ("a" * 300, "a" * 255),
    ):
        assert decode(*encode(wire.Cue(text))) == wire.Cue(kept)


def _info(kind: Format) -> wire.StreamInfo:
    return wire.StreamInfo(1, 1, 0, (GYR, ACC), kind, 100.0, (0.001, 0.01), (32.0, 320.0))


def _sent(values: np.ndarray, info: wire.StreamInfo) -> np.ndarray:
    data = encode_values(values, info)
    return decode_values([wire.Samples(1, 0, 0, 0, len(values), data)], info, values.shape[1])


def test_counts_bring_values_back_to_half_a_count(rng: np.random.Generator) -> None:
    values = rng.uniform(-30, 30, (7, 3, 6))
    back = _sent(values, _info(Format.INT16))
    assert np.abs(back - values)[..., :3].max() <= 0.0005 + 1e-12
    assert np.abs(back - values)[..., 3:].max() <= 0.005 + 1e-12


def test_floats_bring_values_back_to_single_precision(rng: np.random.Generator) -> None:
    values = rng.normal(size=(7, 3, 6))
    np.testing.assert_array_equal(
        _sent(values, _info(Format.FLOAT32)), values.astype("<f4").astype(float)
    )


@pytest.mark.parametrize("kind", Format)
def test_missing_values_stay_missing_and_large_ones_stop_at_the_limit(kind: Format) -> None:
    values = np.zeros((2, 1, 6))
    values[0, 0, 0], values[1, 0, 1], values[1, 0, 2] = np.nan, 1e6, -1e6
    back = _sent(values, _info(kind))
    assert np.isnan(back).sum() == 1
    assert np.isnan(back[0, 0, 0])
    limit = 32.767 if kind is Format.INT16 else 1e6
    np.testing.assert_allclose(back[1, 0, 1:3], [limit, -limit])


@given(st.binary(min_size=24, max_size=24))
def test_any_bits_make_values(data: bytes) -> None:
    """Signalling NaN among them."""
    for info in (
        _info(Format.FLOAT32),
        replace(_info(Format.INT16), quantities=(GYR, ACC), scale=(3e38, 1e-45)),
    ):
        count = 1 if info.format is Format.FLOAT32 else 2
        assert decode_values([wire.Samples(1, 0, 0, 0, count, data)], info, 1).shape == (
            count,
            1,
            6,
        )


def test_a_signalling_nan_is_a_missing_value() -> None:
    data = np.array([0x7F800001] * 6, "<u4").tobytes()
    assert np.isnan(
        decode_values([wire.Samples(1, 0, 0, 0, 1, data)], _info(Format.FLOAT32), 1)
    ).all()


@pytest.mark.parametrize(("size", "fit"), [(23, False), (24, True), (36, False)])
def test_bytes_that_are_no_whole_samples_do_not_fit(size: int, fit: bool) -> None:
    assert (
        has_expected_size(
            wire.Samples(1, 0, 0, 0, 2, bytes(size)),
            replace(_info(Format.INT16), quantities=(GYR, ACC)),
            1,
        )
        == fit
    )
