"""Options as a person writes them: what is refused, and that every value that is not refused can be computed with."""

import re

import numpy as np
import pytest

from handscope.app.options import with_options
from handscope.estimators.data.options import describe
from handscope.estimators.errors import InputError
from handscope.estimators.force.tip_orientation import TipParams
from handscope.estimators.measures.reach_place import PlaceMeasure
from handscope.estimators.methods import METHODS
from handscope.estimators.pipeline.process import process
from tests.simulated import pose_and_wiggle

M2 = METHODS["m2"]
NUMBERS = [d for d in describe(M2.Params) if d.kind == "float"]
REFUSED = {("pose_duration", 60.0): "hold the pose longer"} | {
    (name, 0.0): "not still" for name in ("pose_rate", "pose_tilt", "pose_bias")
}
EDGES = [(d.name, value) for d in NUMBERS for value in (d.least, d.most)]


@pytest.mark.parametrize(
    ("option", "value", "words"),
    [
        ("tau_acc", "-1", "option tau_acc is '-1'; it is between 0.01 and 1e+06 s"),
        ("tau_acc", 0, "option tau_acc is '0'; it is between 0.01 and 1e+06 s"),
        ("rest_gyr", "nan", "option rest_gyr is 'nan'; it is between 0.01 and 1e+06 deg/s"),
        ("max_gap", "-1", "option max_gap is '-1'; it is between 0 and 1 s"),
        ("pose_duration", "-1", "option pose_duration is '-1'; it is between 0.5 and 60 s"),
        ("alignment", "best", "option alignment is 'best'; it is one of full, common, heading"),
        ("constraints", "perhaps", "option constraints is 'perhaps'; it is true or false"),
    ],
)
def test_a_value_out_of_its_range_is_refused_with_the_range(
    option: str, value: object, words: str
) -> None:
    with pytest.raises(InputError, match=f"^{re.escape(words)}$"):
        with_options(M2.Params, {option: value})


@pytest.mark.parametrize(("name", "value"), EDGES)
def test_every_value_at_the_edge_of_its_range_gives_a_result_or_a_sentence(
    name: str, value: float
) -> None:
    recording = pose_and_wiggle("left")
    params = with_options(M2.Params, {name: value})
    if refusal := REFUSED.get((name, value)):
        with pytest.raises(InputError, match=refusal):
            process(M2, params, recording)
    else:
        assert np.isfinite(process(M2, params, recording).trajectory.q_GS).all()


@pytest.mark.parametrize(
    ("params", "earlier", "present"),
    [
        (PlaceMeasure, "smallest_way", "least_peak_speed"),
        (PlaceMeasure, "unit_apart", "unit_interval"),
        (TipParams, "alike", "acc_error_time"),
    ],
)
def test_an_option_is_taken_by_its_name_of_the_first_edition(
    params: type, earlier: str, present: str
) -> None:
    assert vars(with_options(params, {earlier: "0.3"}))[present] == 0.3
