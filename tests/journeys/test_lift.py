"""Weighing with force sensors that read wrongly and a glove that keeps no calibration: calibrated once by hand, right from then on."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from handscope.validation.benchmarks.server_under_test import glove
from tests.journeys.house import (
    LONG,
    ROOT,
    Server,
    act,
    end_session,
    figure,
    keep_picture,
    name_port,
    new_patient,
    shown,
)

pytestmark = pytest.mark.browser
GRAVITY = 9.80665
TRUE = 0.28  # kg that the virtual patient lifts
MATRIX, OFFSET = (
    np.diag([0.6, 0.7, 0.65]),
    np.array([0.5, -0.25, 1.0]),
)  # newtons of what the sensors send: uncalibrated, all is half as heavy again
DOWN = {
    "none": (0, 0, 0),
    "+x": (1, 0, 0),
    "-x": (-1, 0, 0),
    "+y": (0, 1, 0),
    "-y": (0, -1, 0),
    "+z": (0, 0, 1),
    "-z": (0, 0, -1),
}


def _sensors(folder: Path) -> Path:
    told = {
        "channels": [{"name": n, "units": "N"} for n in "xyz"],
        "matrix": MATRIX.tolist(),
        "offset": OFFSET.tolist(),
        "scale_sd": 0.01,
    }
    path = folder / "sensors.json"
    path.write_text(
        json.dumps({"ForceSetup": dict.fromkeys(("thumb_tip_force", "index_tip_force"), told)})
    )
    return path


def _loads(folder: Path) -> Path:
    """What such a sensor reads of weights hung from it."""
    rng, lines = np.random.default_rng(2), ["x [N],y [N],z [N],mass [g],down"]
    for grams in (200, 500):
        for way, down in DOWN.items():
            pushed = -1e-3 * grams * GRAVITY * np.array(down)
            read = np.linalg.inv(MATRIX) @ pushed + OFFSET + 0.005 * rng.normal(size=3)
            lines.append(
                ",".join([*(f"{v:.4f}" for v in read), str(grams if any(down) else 0), way])
            )
    path = folder / "loads.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.slow
def test_a_glove_calibrated_by_hand_weighs_right(
    another_page: Callable[..., Page], server: Server, tmp_path: Path
) -> None:
    page, port = another_page(scene=False, at=None), tmp_path / "glove"
    with glove(
        port,
        "--hand",
        "left",
        "--strips",
        "thumb,index,force",
        "--force-setup",
        str(_sensors(tmp_path)),
        "--untold",
    ):
        patient_page = f"{server.base}/patients/{new_patient(page)}"
        _begin(page, patient_page, port)
        told = page.locator(".glove details > .soft").last
        expect(told).to_contain_text("Force sensors not calibrated: thumb, index finger")
        told.scroll_into_view_if_needed()
        keep_picture(page, "glove-uncalibrated")
        end_session(page)
        for finger in ("thumb", "index"):
            words = [
                "calibrate-force",
                str(_loads(tmp_path)),
                "--finger",
                finger,
                "--keep",
                str(port),
                "--data",
                str(server.data),
            ]
            subprocess.run(
                [sys.executable, "-P", "-m", "handscope.app.cli", *words],
                cwd=ROOT,
                check=True,
                stdout=subprocess.DEVNULL,
            )
        _begin(page, patient_page, port)
        expect(told).to_contain_text("Force sensors calibrated: thumb, index finger")
        told.scroll_into_view_if_needed()
        keep_picture(page, "glove-calibrated")
        _lift(page)
    shown(page.get_by_role("heading", name="Lift", exact=True), 2 * LONG)
    mass = float(figure(page, "Estimated mass, if these fingers alone carry it").split(" ")[0])
    assert abs(mass - TRUE) < 0.1 * TRUE
    keep_picture(page, "session-lift")


def _begin(page: Page, patient_page: str, port: Path) -> None:
    name_port(page, patient_page, port)
    page.get_by_role("button", name="Start session").click()
    page.wait_for_url("**/stations/*")
    shown(act(page, "continue"))


def _lift(page: Page) -> None:
    act(page, "continue").click()
    shown(act(page, "start")).click()
    shown(act(page, "accept")).click()
    shown(page.get_by_label("Which tasks?")).select_option("force")
    shown(page.locator('[data-task="lift"]')).click()
    shown(act(page, "start")).click()
    shown(act(page, "accept")).click()
    shown(act(page, "finish"))
    end_session(page)
