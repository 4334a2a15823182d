"""An S3 server of the tests' own, where its packages are installed."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import pytest

MISSING = "no S3 server (moto) or no s3fs on this machine: make lock, then make check"
BUCKET = "recordings"


class S3Server:
    """Answers at one address; what was put there stays while it is stopped."""

    def __init__(self) -> None:
        self._server = _started(0)
        self.port = self._server.get_host_and_port()[1]

    def stop(self) -> None:
        self._server.stop()

    def start(self) -> None:
        self._server = _started(self.port)


@contextmanager
def server() -> Iterator[S3Server]:
    """A server with an empty bucket, known to every S3 client of this process and its children by the environment. Skips the test where there is none."""
    pytest.importorskip("s3fs", reason=MISSING)
    pytest.importorskip("flask_cors", reason=MISSING)
    pytest.importorskip("moto", reason=MISSING)
    logging.getLogger("werkzeug").setLevel(logging.ERROR)
    found = S3Server()
    with pytest.MonkeyPatch.context() as patch:
        for name, value in {
            "AWS_ENDPOINT_URL_S3": f"http://127.0.0.1:{found.port}",
            "AWS_ACCESS_KEY_ID": "tests",
            "AWS_SECRET_ACCESS_KEY": "tests",
            "AWS_DEFAULT_REGION": "us-east-1",
        }.items():
            patch.setenv(name, value)
        import s3fs

        s3fs.S3FileSystem.clear_instance_cache()  # those know another server's address
        s3fs.S3FileSystem(skip_instance_cache=True).makedirs(BUCKET, exist_ok=True)
        try:
            yield found
        finally:
            with suppress(Exception):  # a test may have stopped it
                found.stop()


def _started(port: int) -> Any:
    from moto.server import ThreadedMotoServer

    server = ThreadedMotoServer("127.0.0.1", port, verbose=False)
    server.start()
    return server
