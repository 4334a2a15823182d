"""How the server listens."""

import asyncio
import socket

from handscope.app.serving import _listen


def test_a_small_message_does_not_wait_for_the_last_one_to_be_acknowledged() -> None:
    async def nodelay() -> int:
        reached: asyncio.Future[int] = asyncio.get_running_loop().create_future()

        def accepted(_: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            reached.set_result(
                writer.get_extra_info("socket").getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
            )
            writer.close()

        listener = _listen("127.0.0.1", 0)
        async with await asyncio.start_server(accepted, sock=listener):
            _, writer = await asyncio.open_connection(*listener.getsockname())
            try:
                return await reached
            finally:
                writer.close()

    assert asyncio.run(nodelay()) == 1
