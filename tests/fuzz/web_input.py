"""What comes over the web beside files: a browser's relay, photographs, answers of FHIR servers."""

import io
import json
import math
import struct
from pathlib import Path

import numpy as np

from handscope.app.devices.relay.messages import (
    BrowserClock,
    MalformedError,
    Pace,
    TooLargeError,
    parse_chunk,
    parse_hello,
    parse_words,
)
from handscope.app.exporting import fhir_server
from handscope.app.photograph.pictures import open_photograph, without_description
from handscope.sessions.wire.assembly import Assembler

NOW = 1000.0  # s, when everything arrives
BETWEEN = b"\1\0\1"


def relay(data: bytes, folder: Path) -> None:
    """Messages of one connection, the first of them words; what is malformed ends it."""
    first, *messages = data.split(BETWEEN)
    pace, assembler, newest = Pace(lambda: NOW), Assembler(), -math.inf
    try:
        hello = parse_hello(parse_words(first.decode("utf-8", "replace")))
        clock = BrowserClock(hello.now, NOW)
        for message in messages:
            wait = pace.wait(len(message))
            assert 0 <= wait < math.inf
            chunk = parse_chunk(message)
            at = clock.arrival(chunk.time, NOW)
            assert newest <= at <= NOW + 1e-9
            newest = at
            list(assembler.feed(chunk.data, at))
    except (MalformedError, TooLargeError):
        pass


def relay_seeds() -> list[bytes]:
    """A greeting and three messages of a glove."""
    from tests.glove import frames, whole_session
    from tests.simulated import cut, in_strips

    samples = {name: cut(in_strips("left").samples[name], [20])[0] for name in ("hand", "index")}
    sent = b"".join(frames([s.message for s in whole_session(samples)]))
    parts = [sent[k : k + 400] for k in range(0, 1200, 400)]
    chunks = [struct.pack("<Qd", k, 1.7e12 + 50 * k) + part for k, part in enumerate(parts)]
    hello = json.dumps({"token": "abc", "now": 1.7e12}).encode()
    return [BETWEEN.join([hello, *chunks])]


def photograph(data: bytes, folder: Path) -> None:
    """A picture that is measured, and kept without its description."""
    found = open_photograph(data, "left")
    assert np.isfinite(found.camera.misfit)
    without_description(data)


def photograph_seeds() -> list[bytes]:
    """The printed sheet itself, seen straight from above, with the description that a camera writes."""
    from PIL import Image

    from handscope.app.language import languages
    from handscope.app.photograph.printing import print_sheet
    from handscope.estimators.hand.geometry import sized
    from handscope.estimators.photograph.sheet import Sheet

    png = print_sheet(Sheet("a4", "left"), sized("left"), languages()["en"], "png", 100.0)
    about = Image.Exif()
    about.get_ifd(0x8769)[0xA405] = 26
    made = io.BytesIO()
    with Image.open(io.BytesIO(png)) as picture:
        picture.convert("L").save(made, "JPEG", quality=60, exif=about.tobytes())
    return [made.getvalue()]


class _Answer:
    """Of a server: the first byte says which status, the others are its body."""

    def __init__(self, data: bytes) -> None:
        self.status_code = 200 if data[:1] == b"2" else 422
        self._body = data[1:]

    def json(self) -> object:
        return json.loads(self._body)


def fhir_answer(data: bytes, folder: Path) -> None:
    """What a FHIR server answers to a bundle."""
    assert fhir_server._taken(_Answer(data), "https://fhir.example.org/r4") >= 0


def fhir_seeds() -> list[bytes]:
    """Everything stored."""
    stored = {"type": "transaction-response", "entry": [{"response": {"status": "201 Created"}}]}
    return [b"2" + json.dumps(stored).encode()]
