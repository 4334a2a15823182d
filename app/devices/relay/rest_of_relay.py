"""What a browser still keeps of a session that is over: its server went away, or the line did. It goes behind what the recording has."""

import threading
import time
from collections.abc import Callable
from pathlib import Path

from handscope.app.devices.relay.messages import Chunk
from handscope.sessions.files.continued_recording import ContinuedRecording

SYNC_EVERY = 0.5  # s


class RestOfRelay:
    """A RelayEnd; `on_complete` is called once all has come and the recording is finished."""

    is_ending = True  # a port is not read any further

    def __init__(self, recording: Path, on_complete: Callable[[], object]) -> None:
        """InputError where there is no recording."""
        self._recording = ContinuedRecording(recording)
        self._on_complete = on_complete
        self._taking = threading.Lock()
        self._synced = time.monotonic()
        self._notify: Callable[[], object] | None = None
        self.on_disk = self._recording.written

    @property
    def next_number(self) -> int:
        return self._recording.written

    @property
    def newest(self) -> float:
        newest: float = self._recording.newest
        return newest

    def attach(self, notify: Callable[[], object]) -> None:
        before, self._notify = self._notify, notify
        if before is not None:
            before()

    def detach(self, notify: Callable[[], object]) -> None:
        if self._notify is notify:
            self._notify = None

    def is_attached(self, notify: Callable[[], object]) -> bool:
        return self._notify is notify

    def set_port(self, is_open: bool) -> None:
        """No command waits for it any more."""

    def take(self, chunk: Chunk, at: float) -> None:
        with self._taking:
            if chunk.number == self.next_number:
                self._recording.write(chunk.data, max(at, self.newest))
        if time.monotonic() - self._synced >= SYNC_EVERY:
            self._sync()

    def commands(self) -> list[bytes]:
        return []

    def finish(self, total: int) -> None:
        self._sync()
        if self.on_disk >= total:
            self._recording.close()
            self._on_complete()

    def close(self) -> None:
        """Finish the recording with what has come."""
        self._recording.close()

    def _sync(self) -> None:
        self._recording.sync()
        self._synced, self.on_disk = time.monotonic(), self._recording.written
        if self._notify is not None:
            self._notify()
