"""Reading a native recording: whole, cut anywhere, with bytes flipped, of another program."""

from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.writer import Writer

from handscope.estimators.data.magnet_declaration import Plate
from handscope.estimators.data.samples import Event
from handscope.estimators.errors import InputError
from handscope.sessions.files import native, recording_file
from handscope.sessions.files.recorder import FORMAT_VERSION, Recorder
from handscope.sessions.files.recording_file import Findings, read_messages
from handscope.sessions.formats import recordings as formats_recordings
from handscope.sessions.wire.framing import Encoder
from handscope.sessions.wire.messages import Format, Mark
from tests.glove import NS, ON, as_float32, frames, identity, info, strip, whole_session
from tests.simulated import cut, in_strips

SAMPLES = {name: cut(in_strips("left").samples[name], [250])[0] for name in ("hand", "index")}
EVENT = Event(0.5, 1.0, "task", {"task_name": "rom"})


def _record(path: Path, hand: str = "left", **metadata: object) -> list[tuple[float, bytes]]:
    """A short session; what was given to the recorder."""
    encoder, written = Encoder(), []
    with Recorder(path, {"hand": hand, **metadata}, 100.0) as recorder:
        for sent in whole_session(SAMPLES, Format.FLOAT32):
            written.append((sent.arrival, encoder.frame(sent.message)))
            recorder.write(written[-1][1], sent.arrival)
        recorder.event("e", EVENT, 103.0)
        recorder.metadata(
            {"geometry": {"hand_length": 0.19}, "mounting": {"index_middle": [0, 0, 1, 0]}}, 103.0
        )
    return written


class Recorded:
    """A file, its bytes, and what was given to the recorder (no dataclass: hypothesis would print it all)."""

    def __init__(self, path: Path) -> None:
        self.path, self.written = path, _record(path)
        self.whole = path.read_bytes()


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    return Recorded(tmp_path_factory.mktemp("native") / "whole.mcap")


def test_a_recording_is_what_the_glove_sent(recorded: Recorded) -> None:
    recording = formats_recordings.load(recorded.path)
    assert set(recording.samples) == {"hand", "index"}
    for name, block in SAMPLES.items():
        np.testing.assert_array_equal(recording.samples[name].values, as_float32(block))
        np.testing.assert_allclose(
            recording.samples[name].t, block.t - SAMPLES["hand"].t[0], atol=2e-9
        )
    assert recording.hand == "left"
    assert recording.events == (EVENT,)
    assert recording.geometry.palm_length == pytest.approx(0.19 * 0.446)
    np.testing.assert_array_equal(recording.mounting["index_middle"], [0, 0, 1, 0])
    assert recording.warnings == ()
    assert recording.losses == {"hand": 0, "index": 0}
    assert recording.source == {
        "format": "native", "software": "", "port": "", "device": "Test glove", "device_id": "0000000000c0ffee", "firmware": "2.1",
    }  # fmt: skip
    assert recording.checksum == native.file_checksum(recorded.path)


@given(st.data())
def test_cut_anywhere_every_whole_message_is_there(
    tmp_path_factory: pytest.TempPathFactory, recorded: Recorded, data: st.DataObject
) -> None:
    whole, written = recorded.whole, recorded.written
    at = data.draw(st.integers(0, len(whole)) | st.integers(0, 400))
    path = tmp_path_factory.getbasetemp() / "cut.mcap"
    path.write_bytes(whole[:at])
    try:
        contents = native.read(path)
    except InputError:
        if at > 500:  # the first message, the metadata, is whole
            raise
        return
    assert contents.wire == [
        (pytest.approx(a, abs=1e-9), d) for a, d in written[: len(contents.wire)]
    ]
    assert contents.file.unread < 500  # bytes: one message
    assert contents.file.finished == (at >= len(whole) - 8)
    assert contents.file.damaged == 0


def test_records_are_those_of_mcaps_own_reader(
    recorded: Recorded, monkeypatch: pytest.MonkeyPatch
) -> None:
    ours = list(read_messages(BytesIO(recorded.whole), Findings()))
    monkeypatch.setattr(recording_file, "_records_inside", lambda chunk: None)  # the others' way
    assert ours == list(read_messages(BytesIO(recorded.whole), Findings()))
    assert len(ours) > 5


def test_a_cut_recording_opens_with_a_warning(tmp_path: Path, recorded: Recorded) -> None:
    path = tmp_path / "cut.mcap"
    path.write_bytes(recorded.whole[: len(recorded.whole) // 2])
    recording = native.load(path)
    assert "was not closed" in recording.warnings[0]
    assert 0.5 < recording.duration < 1.5


@given(
    st.dictionaries(
        st.floats(0, 1, exclude_max=True) | st.floats(0, 0.02),
        st.integers(1, 255),
        min_size=1,
        max_size=4,
    )
)
def test_flipped_bytes_cost_only_the_messages_that_they_hit(
    tmp_path_factory: pytest.TempPathFactory, recorded: Recorded, flips: dict[float, int]
) -> None:
    whole, written = recorded.whole, recorded.written
    damaged = bytearray(whole)
    places = {int(share * len(whole)): how for share, how in flips.items()}
    for place, how in places.items():
        damaged[place] ^= how
    path = tmp_path_factory.getbasetemp() / "flipped.mcap"
    path.write_bytes(damaged)
    contents = native.read(path)  # a few bytes must not take the whole recording away
    native.load(path, "left")  # metadata and identity may both be hit
    kept = {d for _, d in contents.wire}
    assert kept <= {d for _, d in written}
    assert len(written) - len(contents.wire) <= len(places)
    if len(contents.wire) < len(written):
        assert contents.file.damaged > 0


def test_damage_is_told(tmp_path: Path, recorded: Recorded) -> None:
    damaged = bytearray(recorded.whole)
    damaged[len(damaged) // 2] ^= 0xFF
    path = tmp_path / "damaged.mcap"
    path.write_bytes(damaged)
    warnings = native.load(path).warnings
    assert "1 piece of the recording is damaged" in warnings[0]
    assert any("lost samples" in w for w in warnings)


@pytest.mark.parametrize("how", [0x01, 0x02, 0x10, 0x80, 0xFF])
@pytest.mark.parametrize("byte", range(1, 9))
def test_a_length_that_was_hit_costs_its_own_message_only(
    tmp_path: Path, recorded: Recorded, byte: int, how: int
) -> None:
    damaged = bytearray(recorded.whole)
    chunk = damaged.index(b"zstd", len(damaged) // 2) - 41
    assert damaged[chunk] == 6  # a chunk record: opcode, then eight bytes of length
    damaged[chunk + byte] ^= how
    path = tmp_path / "damaged.mcap"
    path.write_bytes(damaged)
    contents = native.read(path)
    assert (len(contents.wire), contents.file.damaged) == (len(recorded.written) - 1, 1)


def test_damage_in_the_last_message_is_told_too(tmp_path: Path, recorded: Recorded) -> None:
    damaged = bytearray(recorded.whole)
    damaged[-60] ^= 0xFF
    path = tmp_path / "damaged.mcap"
    path.write_bytes(damaged)
    contents = native.read(path)
    assert (contents.file.finished, contents.file.damaged) == (True, 1)


@given(st.binary(max_size=300))
def test_no_file_makes_it_fail_otherwise(
    tmp_path_factory: pytest.TempPathFactory, garbage: bytes
) -> None:
    path = tmp_path_factory.getbasetemp() / "garbage.mcap"
    for content in (garbage, b"\x89MCAP0\r\n" + garbage):
        path.write_bytes(content)
        with pytest.raises(InputError, match=r"garbage\.mcap"):
            native.load(path)


def _foreign(path: Path, topic: str, data: bytes, profile: str = "") -> None:
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile=profile)
        writer.add_message(writer.register_channel(topic, "json", 0), 0, data, 0)
        writer.finish()


@pytest.mark.parametrize(
    ("topic", "data", "words"),
    [
        ("/camera", b"\xff", "is no Handscope recording"),
        ("event", b"[1, 2", "is not Handscope's"),
        ("event", b"{}", "is not Handscope's"),
        ("event", b'{"id": "a", "when": 3}', "is not Handscope's"),
        ("metadata", b"3", "is not Handscope's"),
        ("metadata", b'{"hand": "left"}', "is no Handscope recording"),
    ],
)
def test_an_mcap_file_of_another_program_is_refused(
    tmp_path: Path, topic: str, data: bytes, words: str
) -> None:
    path = tmp_path / "other.mcap"
    _foreign(path, topic, data)
    with pytest.raises(InputError, match=words):
        native.load(path)


def test_a_recording_of_a_later_format_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "later.mcap"
    _record(path, format_version=FORMAT_VERSION + 1)
    with pytest.raises(InputError, match=f"format {FORMAT_VERSION + 1}.*newer version"):
        native.load(path)


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.mcap"):
        native.load(tmp_path / "none.mcap")


def test_the_gloves_hand_and_the_sessions_must_agree(tmp_path: Path) -> None:
    path = tmp_path / "right.mcap"
    _record(path, hand="right")
    with pytest.raises(InputError, match="says right hand, the glove says left"):
        native.load(path)


def test_the_hand_wanted_must_be_the_one_recorded(recorded: Recorded) -> None:
    assert native.load(recorded.path, "left").hand == "left"
    with pytest.raises(InputError, match="of the left hand, not of the right"):
        native.load(recorded.path, "right")


def test_a_recording_that_does_not_say_its_hand_takes_the_one_given(tmp_path: Path) -> None:
    path = tmp_path / "unknown.mcap"
    with Recorder(path, {}, 100.0) as recorder:
        recorder.write(b"".join(frames([identity(hand=None), strip("hand"), info("hand")])), 100.0)
    with pytest.raises(InputError, match="neither"):
        native.load(path)
    assert native.load(path, "right").hand == "right"


def test_an_impossible_hand_geometry_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "giant.mcap"
    with Recorder(path, {"hand": "left", "geometry": {"hand_length": 190}}, 0.0):
        pass
    with pytest.raises(InputError, match="metres"):
        native.load(path)


def test_a_recording_without_samples_is_refused_where_one_is_to_be_processed(
    tmp_path: Path,
) -> None:
    path = tmp_path / "empty.mcap"
    with Recorder(path, {"hand": "left"}, 0.0):
        pass
    assert native.load(path).samples == {}
    with pytest.raises(InputError, match=r"empty\.mcap has no inertial samples"):
        formats_recordings.load(path)


def test_bursts_that_were_never_described_are_a_warning(tmp_path: Path) -> None:
    path, sent = tmp_path / "odd.mcap", whole_session(SAMPLES)
    with Recorder(path, {"hand": "left"}, 100.0) as recorder:
        recorder.write(
            b"".join(frames(s.message for s in sent if s.message != strip("index"))), 100.0
        )
    assert [w for w in native.load(path).warnings if "50 bursts of samples were left out" in w]


def test_what_the_glove_marked_is_an_event(tmp_path: Path) -> None:
    path = tmp_path / "marked.mcap"
    with Recorder(path, {"hand": "left"}, 100.0) as recorder:
        messages = [
            *(s.message for s in whole_session(SAMPLES)),
            Mark(round((ON + 1) * NS), round(NS), "annotation", {"note": "button"}),
        ]
        recorder.write(b"".join(frames(messages)), 100.0)
        recorder.event("e", EVENT, 101.0)
    assert [(e.trial_type, e.onset) for e in native.load(path).events] == [
        ("task", 0.5),
        ("annotation", pytest.approx(1.0)),
    ]


def test_a_strip_described_anew_goes_on_as_a_stream_of_its_own(tmp_path: Path) -> None:
    path, sent = tmp_path / "anew.mcap", [s.message for s in whole_session(SAMPLES)]
    half = len(sent) // 2
    with Recorder(path, {"hand": "left"}, 100.0) as recorder:
        recorder.write(
            b"".join(frames([*sent[:half], info("index", rate=200.0), *sent[half:]])), 100.0
        )
    recording = native.load(path)
    assert {name: b.stream.rate for name, b in recording.samples.items()} == {
        "hand": 100.0,
        "index": 100.0,
        "index-2": 200.0,
    }
    assert recording.samples["index-2"].stream.name == "index-2"
    assert len(recording.samples["index"].t) + len(recording.samples["index-2"].t) == len(
        SAMPLES["index"].t
    )


def test_where_magnetometers_and_magnet_are_is_kept_as_the_glove_tells_and_as_somebody_measured_it_better(
    tmp_path: Path,
) -> None:
    told = Plate({"trunk_mag_1": (0.0, 0.125, 0.0)}, (0.0, 0.0, 0.5), (0.0, 0.25, 0.0), 2.0**-14)
    for name, metadata in (
        ("glove", {}),
        (
            "person",
            {
                "magnet_setup": {
                    "places": {"trunk_mag_1": [0, 0.1, 0]},
                    "moment": [0, 0, 0.3],
                    "earth": 5e-5,
                }
            },
        ),
    ):
        with Recorder(tmp_path / f"{name}.mcap", {"hand": "left", **metadata}, 100.0) as recorder:
            for frame in frames([identity(), told]):
                recorder.write(frame, 100.0)
    assert native.load(tmp_path / "glove.mcap").plate == told
    measured = native.load(tmp_path / "person.mcap").plate
    assert measured == Plate(
        {"trunk_mag_1": (0.0, 0.1, 0.0)}, (0.0, 0.0, 0.3), (0.0, 0.0, 0.0), 5e-5
    )


def test_strips_found_on_each_others_finger_are_read_as_worn_from_the_beginning(
    tmp_path: Path,
) -> None:
    two = {
        name: cut(in_strips("left").samples[name], [250])[0] for name in ("hand", "index", "ring")
    }
    path, encoder = tmp_path / "exchanged.mcap", Encoder()
    with Recorder(path, {"hand": "left"}, 100.0) as recorder:
        for sent in whole_session(two, Format.FLOAT32):
            recorder.write(encoder.frame(sent.message), sent.arrival)
        recorder.metadata(
            {"exchanged_strips": {"index": "ring", "ring": "index"}}, 103.0
        )  # found out at the end
    read, plain = formats_recordings.load(path), in_strips("left")
    for finger, other in (("index", "ring"), ("ring", "index")):
        assert read.samples[finger].stream.sensors == plain.samples[finger].stream.sensors
        np.testing.assert_array_equal(read.samples[finger].values, as_float32(two[other]))
    assert read.warnings == (
        "the strip of the index finger was worn on the ring finger and is read as that",
        "the strip of the ring finger was worn on the index finger and is read as that",
    )
