"""Find a Chromium for the browser tests, or install one: Debian's as root, otherwise the test tool's own. Prints its path."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

UNDRAWN = """
  for (const drawing of ["drawArrays", "drawArraysInstanced", "drawElements", "drawElementsInstanced", "drawRangeElements"])
    WebGL2RenderingContext.prototype[drawing] = () => {};
"""  # for pages whose scene nobody looks at: without a graphics card its light takes ten seconds of a core and each picture half a second
KEPT_APART = "--enable-features=SplitCacheByNetworkIsolationKey"  # what frames show is kept apart from what pages fetch, as in a browser with a window
NAMES = (
    "chromium-headless-shell",
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
)  # the first has no window to draw: a journey costs half the processor time


def chromium() -> str | None:
    """The path of a Chromium on this machine."""
    for name in NAMES:
        if path := shutil.which(name):
            return path
    return _own()


def _own() -> str | None:
    """The one that the test tool keeps for itself."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as tool:
        path = tool.chromium.executable_path
    return path if Path(path).exists() else None


def install() -> None:
    """Debian's package as root where there is one, else the test tool's own."""
    if shutil.which("apt-get") and hasattr(os, "geteuid") and os.geteuid() == 0:
        subprocess.run(["apt-get", "update", "-qq"], check=False)
        if any(_from_debian(package) for package in NAMES[:2]):
            return
    subprocess.run([sys.executable, "-m", "playwright", "install", "chromium"], check=True)


def _from_debian(package: str) -> bool:
    done = subprocess.run(
        ["apt-get", "install", "-y", "-qq", "--no-install-recommends", package],
        check=False,
        env={**os.environ, "DEBIAN_FRONTEND": "noninteractive"},
    )
    return done.returncode == 0


if __name__ == "__main__":
    if chromium() is None:
        print("no Chromium found: installing one for the browser tests", flush=True)
        install()
    found = chromium()
    print(
        f"browser tests use {found}"
        if found
        else "no Chromium could be installed; install one and run again",
        flush=True,
    )
    sys.exit(0 if found else 1)
