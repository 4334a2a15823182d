"""From the command to the first page: a server on an empty data folder."""

import tempfile
import time
import urllib.request
from pathlib import Path

from handscope.validation.benchmarks import Metric
from handscope.validation.benchmarks.server_under_test import Client, server


def measure() -> list[Metric]:
    """Seconds until the patients page and its data are there."""
    with tempfile.TemporaryDirectory() as folder:
        began = time.monotonic()
        with server(Path(folder)) as (address, _):
            client = Client(address)
            with urllib.request.urlopen(
                urllib.request.Request(client.base + "/", headers={"Cookie": client.cookie})
            ) as page:
                page.read()
            client.call("GET", "/api/patients")
            took = time.monotonic() - began
    return [Metric("start to first page", took, "s", 5.0, "lower")]
