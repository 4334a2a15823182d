import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handscope.estimators.errors import InputError
from handscope.estimators.numerics import quaternions as quat
from handscope.sessions.formats.derivative import calibration_table
from handscope.sessions.tables_io import calibration_result
from tests.simulated import calibrated, pose_and_wiggle

TOLD, NOT_TOLD = np.radians([0.1, 0.1, 0.5]), np.radians([0.1, 0.1, 5.0])


def test_what_movement_told_comes_back_and_what_a_nominal_mounting_told_does_not(
    tmp_path: Path,
) -> None:
    found = replace(
        calibrated(pose_and_wiggle("left")),
        q_BS_sd={"index_proximal": TOLD, "index_distal": NOT_TOLD},
        lengths_sd={"index_proximal": 2e-4},
        acc_bias={"hand": np.array([0.1, -0.2, 0.05])},
    )
    path = tmp_path / "sub-01_task-free_desc-map_calibration.json"
    path.write_text(json.dumps(calibration_table(found)))
    known = calibration_result.read(path)
    assert known.hand == "left"
    assert set(known.q_BS) == {"index_proximal"}
    assert (
        quat.angle(quat.relative(known.q_BS["index_proximal"], found.q_BS["index_proximal"])) < 1e-9
    )
    assert known.lengths == {"index_proximal": found.geometry.lengths["index_proximal"]}
    np.testing.assert_array_equal(known.q_BS_sd["index_proximal"], TOLD)
    assert known.lengths_sd == {"index_proximal": 2e-4}
    np.testing.assert_array_equal(known.gyr_bias["hand"], found.gyr_bias["hand"])
    np.testing.assert_array_equal(known.acc_bias["hand"], found.acc_bias["hand"])
    assert not known.of_hand().acc_bias, "another glove has other sensors"


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "{}",
        '{"MeasuredHand": "left"}',
        '{"MeasuredHand": "both", "segment_lengths": {}, "sensor_to_segment": {}, "gyr_bias": {}}',
    ],
)
def test_a_file_that_is_no_calibration_is_refused_in_words(tmp_path: Path, text: str) -> None:
    path = tmp_path / "wrong.json"
    path.write_text(text)
    with pytest.raises(InputError, match=r"wrong.json is no .*handscope process --method map"):
        calibration_result.read(path)


def test_a_file_that_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        calibration_result.read(tmp_path / "none.json")
