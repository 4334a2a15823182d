"""The meter of free movement as a station follows it: in strips, a second at a time, beside the tick."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from handscope.app.live.readouts.observability_meter import FreeMeter
from handscope.estimators.alignment import initial_pose
from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.samples import Block
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.hand.geometry import HandGeometry
from handscope.estimators.methods import map_gain
from handscope.estimators.simulation.scenario import Simulated
from tests.estimators.self_calibration.fingers import recorded
from tests.simulated import strips_of


@dataclass
class Followed:
    """What a tracker keeps of a recording up to an instant."""

    made: Simulated
    calibration: Calibration | None
    reached: float = 0.0

    @property
    def geometry(self) -> HandGeometry:
        return self.made.geometry

    def newest_sample(self) -> float:
        return self.reached

    def samples(self, onset: float) -> list[Block]:
        return [b.between(onset, self.reached) for b in self.made.samples.values()]

    def past(self, start: float, stop: float) -> Trajectory:
        return self.made.truth.between(start, stop)


@pytest.fixture
def followed() -> Followed:
    """A finger and the hand's sensor, each on a strip of its own."""
    made = strips_of(recorded(2, 16.0, skin=True))
    sensors = [s for b in made.samples.values() for s in b.stream.sensors]
    return Followed(
        made, initial_pose.uncalibrated("left", made.geometry, made.mounting, sensors, 0.0)
    )


def moved(followed: Followed, stop: float) -> FreeMeter:
    meter = FreeMeter(followed, 2.0)  # type: ignore[arg-type]
    for at in np.arange(2.0, stop, 0.5):
        followed.reached = at
        meter.follow()
        if meter._thread:
            meter._thread.join()
    return meter


def test_it_says_enough_once_the_hand_has_moved_long_enough(followed: Followed) -> None:
    meter = moved(followed, 8.1)
    assert [o.joint for o in meter.observed] == ["index_mcp", "index_pip", "index_dip"]
    assert max(o.share for o in meter.observed) < 0.7 and not meter.is_enough
    assert max(o.length_sd for o in meter.observed) < 1.5e-3
    assert moved(followed, 13.6).is_enough


def test_a_sensor_that_falls_silent_tells_nothing_more(followed: Followed) -> None:
    before = moved(followed, 6.1).observed
    strip = followed.made.samples["index"]
    values = strip.values.copy()
    values[strip.t > 5.7, 2] = np.nan
    followed.made = replace(
        followed.made, samples={**followed.made.samples, "index": replace(strip, values=values)}
    )
    after = moved(followed, 10.1).observed
    assert [o.length_sd for o in after] == pytest.approx([o.length_sd for o in before], rel=0.3)
    assert all(a.share <= 0.5 for a in after)


def test_a_strip_that_is_unplugged_costs_neither_the_others_nor_the_log(
    followed: Followed, caplog: pytest.LogCaptureFixture
) -> None:
    before = moved(followed, 6.1).observed
    strip = followed.made.samples["index"]
    followed.made = replace(
        followed.made, samples={**followed.made.samples, "index": strip.between(0.0, 5.9)}
    )
    after = moved(followed, 10.1).observed
    assert [o.joint for o in after] == [o.joint for o in before]
    assert all(a.share <= b.share + 0.05 for a, b in zip(after, before))
    assert not caplog.records


def test_movement_before_and_after_a_hole_is_not_added_up(followed: Followed) -> None:
    strip = followed.made.samples["index"]
    holed = np.where(((strip.t > 8.0) & (strip.t < 8.2))[:, None, None], np.nan, strip.values)
    followed.made = replace(
        followed.made, samples={**followed.made.samples, "index": replace(strip, values=holed)}
    )
    at_hole, after = moved(followed, 8.6).observed, moved(followed, 13.6)
    assert not after.is_enough, "self-calibration takes the longest part, six seconds"
    assert min(o.share for o in after.observed) >= min(o.share for o in at_hole) > 0.2


def test_before_any_pose_and_when_it_fails_the_station_goes_on(
    followed: Followed, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    calibration, followed.calibration = followed.calibration, None
    assert not moved(followed, 6.1).observed
    followed.calibration = calibration
    monkeypatch.setattr(map_gain, "accumulate_stretch", None)
    assert not moved(followed, 4.1).is_enough
    assert "could not be computed" in caplog.text
