"""A slow line to a server: a rate that all connections share, and a round trip; web sockets, too, which Chromium's own tools let pass at full speed.

Limits  a connection is made at once, packets are never lost, and no window opens slowly
"""

import asyncio
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

PIECE, AHEAD = (
    4096,
    0.01,
)  # bytes; s that a connection may hand over before its turn, as a loop wakes late


class _Way:
    """One direction of the line: its pieces leave one after the other and arrive `delay` s later."""

    def __init__(self, rate: float, delay: float) -> None:
        self._rate, self._delay = rate, delay  # bytes/s, s
        self._free = 0.0  # s, loop's clock: when the line has sent all before

    async def carry(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Until the sender has closed."""
        loop = asyncio.get_running_loop()
        arrival = loop.time()
        while piece := await reader.read(PIECE):
            now = loop.time()
            self._free = max(now, self._free) + len(piece) / self._rate
            arrival = self._free + self._delay
            loop.call_at(arrival, _send, writer, piece)
            await asyncio.sleep(max(self._free - now - AHEAD, 0))
        await asyncio.sleep(max(arrival - loop.time(), 0) + 1e-3)
        writer.close()


def _send(writer: asyncio.StreamWriter, piece: bytes) -> None:
    if not writer.is_closing():
        writer.write(piece)


@contextmanager
def slow_line(port: int, bits_per_s: float, round_trip: float) -> Iterator[int]:
    """The port of a line to `port` of this machine."""
    loop = asyncio.new_event_loop()
    up, down = (_Way(bits_per_s / 8, round_trip / 2) for _ in range(2))

    async def pass_on(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        inner_reader, inner_writer = await asyncio.open_connection("127.0.0.1", port)
        with suppress(OSError):
            await asyncio.gather(up.carry(reader, inner_writer), down.carry(inner_reader, writer))

    thread = threading.Thread(target=loop.run_forever, daemon=True)
    thread.start()
    opened = asyncio.run_coroutine_threadsafe(asyncio.start_server(pass_on, "127.0.0.1", 0), loop)
    try:
        yield opened.result().sockets[0].getsockname()[1]
    finally:
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
