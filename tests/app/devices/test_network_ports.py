"""Gloves at addresses: recorded like a serial port's, refused where nobody allowed them, taken up again after an outage."""

import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path

import pytest

from handscope.app.cli import main
from handscope.app.devices import acquisition, ports
from handscope.estimators.errors import InputError
from handscope.sessions.formats import recordings as formats_recordings

ALLOWED = ["socket://10.1.2.*:4000", "rfc2217://glove-7:2217"]


@pytest.mark.parametrize(
    "port",
    [
        "/dev/ttyACM0",
        "/dev/ttyNOTTHERE",
        "/dev/tty.usbmodem-7",
        "/dev/pts/3",
        "COM3",
        "\\\\.\\COM12",
        "socket://10.1.2.7:4000",
        ALLOWED[1],
    ],
)
def test_ports_of_this_machine_and_allowed_addresses_may_be_opened(port: str) -> None:
    ports.require_allowed(port, ALLOWED)


@pytest.mark.parametrize(
    "port",
    [
        "socket://127.0.0.1:4000",
        "socket://10.1.2.7:22",
        "rfc2217://10.1.2.7:4000",
        "tcp://10.1.2.7:4000",
        "socket://10.1.2.7:4000/../x",
        "socket://10.1.2.1@evil.example:4000",
        "socket://10.1.2.7",
        "socket://:4000",
        "socket://10.1.2.7:99999",
        "\\\\fileserver\\share",
    ],
)
def test_other_addresses_are_refused_without_a_look_at_the_network(
    port: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(socket, "getaddrinfo", lambda *_, **__: pytest.fail("looked up"))
    with pytest.raises(InputError, match=r"port|address"):
        ports.require_allowed(port, ALLOWED)


@pytest.mark.parametrize(
    "port", ["", "x", "/dev/nonsense", "/dev/null", "/etc/passwd", "/dev/ttyS0/../../etc/passwd"]
)
def test_what_is_no_serial_port_is_refused_whether_it_exists_or_not(port: str) -> None:
    with pytest.raises(InputError, match="is not a port of this machine; name a serial port"):
        ports.require_allowed(port, ALLOWED)


def test_a_link_to_a_terminal_and_a_path_that_is_allowed_may_be_opened(tmp_path: Path) -> None:
    (tmp_path / "glove").symlink_to("/dev/pts/3")
    ports.require_allowed(str(tmp_path / "glove"), ALLOWED)
    ports.require_allowed("/opt/gloves/7", ["/opt/gloves/*"])


def test_whoever_does_not_listen_is_named() -> None:
    with closing(socket.create_server(("127.0.0.1", 0))) as free:
        number = free.getsockname()[1]
    with pytest.raises(InputError, match=f"nothing listens at socket://127.0.0.1:{number}"):
        ports.open_port(f"socket://127.0.0.1:{number}")


@pytest.mark.parametrize("silently", [True, False])
def test_a_connection_that_breaks_is_opened_again(
    silently: bool, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A host that closes, and one whose cable was cut: it says nothing any more."""
    monkeypatch.setattr(acquisition, "SILENCE", 0.3)
    server = socket.create_server(("127.0.0.1", 0))
    server.settimeout(20)
    url = f"socket://127.0.0.1:{server.getsockname()[1]}"
    reader = acquisition.Acquisition(url, None, None)  # type: ignore[arg-type]
    thread = threading.Thread(target=reader._reader, daemon=True)
    thread.start()
    try:
        received, hosts = b"", []
        for words in (b"before", b"after"):
            host, _ = server.accept()
            hosts.append(host)
            host.sendall(words)
            while not received.endswith(words):
                received += reader._read.get(timeout=20)[1]
            if not silently:
                host.close()
    finally:
        reader._stop.set()
        thread.join(10)
        for one in (*hosts, server):
            one.close()
    assert received == b"beforeafter"


@contextmanager
def glove_behind_tcp(*words: str) -> Iterator[str]:
    """The address of a virtual glove of hand, index and forearm at 200 Hz."""
    glove = ["glove", "--tcp", "127.0.0.1:0", "--strips", "index,forearm", "--rate", "200", *words]
    program = [sys.executable, "-P", "-m", "handscope.app.cli", *glove]
    with subprocess.Popen(program, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            yield process.stdout.readline().split()[-1]
        finally:
            process.terminate()


@pytest.mark.parametrize("scheme", ["socket", "rfc2217"])
def test_a_glove_in_the_network_is_recorded_without_a_lost_sample(
    scheme: str, tmp_path: Path
) -> None:
    """Directly, and behind a server of serial ports that speaks RFC 2217."""
    if scheme == "rfc2217":
        pytest.importorskip("serial")
        from tests.app.devices.port_server import port_server
    out = tmp_path / "glove.mcap"
    with ExitStack() as open_ones:
        url = open_ones.enter_context(glove_behind_tcp())
        if scheme == "rfc2217":
            url = open_ones.enter_context(port_server(url))
        assert main(["record", url, "--out", str(out), "--seconds", "2"]) == 0
    recording = formats_recordings.load(out)
    assert recording.warnings == () and not any(recording.losses.values())
    assert {s.name for s in recording.streams} == {"hand", "index", "forearm"}
    for stream in recording.streams:
        steps = recording.samples[stream.name].t
        assert len(steps) > 350 and max(steps[1:] - steps[:-1]) < 1.5 / 200
