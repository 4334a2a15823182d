"""Uploads are opened elsewhere: the server goes on meanwhile, whatever becomes of the process that reads."""

import asyncio
import os
import sys
from pathlib import Path

import pytest

from handscope.app.workers.upload_reader import DIED, UploadReader
from handscope.estimators.errors import InputError
from handscope.sessions.motion_bids import writer
from tests.simulated import loaded, pose_and_wiggle


@pytest.mark.skipif(sys.platform == "win32", reason="no named pipes in folders")
def test_the_server_goes_on_while_an_upload_is_read_and_when_its_process_dies(
    tmp_path: Path,
) -> None:
    slow, good, bad = (tmp_path / name for name in ("slow.zip", "good.zip", "upload-7.zip"))
    os.mkfifo(slow)  # whoever reads it waits for ever
    good.write_bytes(writer.pack(writer.tree(loaded(pose_and_wiggle("left")), "01", "wiggle")))
    bad.write_bytes(b"nothing")

    async def go() -> None:
        with UploadReader() as upload_reader:
            found = await upload_reader.read(good, "mine.zip", None)
            assert (found.hand, found.bytes, found.summary["events"][1]["task"]) == (
                "left",
                good.stat().st_size,
                "wiggle",
            )
            waiting = asyncio.create_task(upload_reader.read(slow, "slow.zip", None))
            done, _ = await asyncio.wait([waiting], timeout=0.3)
            assert not done, "it waits, and this goes on"
            upload_reader._process.kill()
            with pytest.raises(InputError) as told:
                await waiting
            assert str(told.value) == DIED
            with pytest.raises(
                InputError, match=r"mine.zip is neither a folder, a zip nor a native recording"
            ):
                await upload_reader.read(bad, "mine.zip", None)

    asyncio.run(go())
