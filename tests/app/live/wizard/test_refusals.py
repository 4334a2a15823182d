"""Why an action is refused: the glove is silent, or the session is at another step."""

import pytest

from handscope.app.live.wizard import machine as wizard_machine
from handscope.app.live.wizard.machine import NotNowError
from handscope.app.live.wizard.transition_table import Action, State
from tests.app.live.wizard.test_machine import READY, at, later


def test_an_action_that_waits_for_samples_is_refused_as_such_and_any_other_as_out_of_place() -> (
    None
):
    silent = later(READY, 1.0, flowing=False)
    with pytest.raises(NotNowError, match="sends nothing at this moment"):
        wizard_machine.act(at(State.POSE_READY), Action.WITHOUT, silent)
    with pytest.raises(NotNowError, match="at this step of the session"):
        wizard_machine.act(at(State.POSE_READY), Action.ENOUGH, silent)
