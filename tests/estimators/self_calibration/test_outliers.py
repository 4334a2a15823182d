"""What is told as a knock: what is large against the usual errors of a hand that moves."""

import numpy as np

from handscope.estimators.data.held_contact import Contact, HeldContact
from handscope.estimators.self_calibration import outliers
from handscope.estimators.self_calibration.sample_preparation import is_free

DT, LIMIT, KNOCK = 0.01, 4.0, 200.0  # s, usual errors
MOVING = np.radians(8.0)  # rad/s
PINCH = (Contact(("thumb", "bottom"), ("index", "bottom")),)


def test_a_hand_held_still_for_most_of_the_time_does_not_make_its_movement_strange() -> None:
    """Contacts are held still: errors of skin are a dozen times what is read meanwhile, and only while the hand moves."""
    t = DT * np.arange(3000)
    gyr = np.where(t > 20.0, 1.0, 0.01)[:, None, None] * np.ones((4, 3))
    held = [HeldContact(PINCH, 4.5, 20.0), HeldContact(PINCH, 25.0, 26.0)]
    free = is_free(held, t, gyr, MOVING)
    assert set(t[~free]) == set(t[(t <= 20.0) | ((t >= 25.0) & (t <= 26.0))])
    off = np.abs(1 + 0.3 * np.random.default_rng(0).standard_normal((len(t), 4)))
    off[t > 20.0] *= 12.0

    def found(off: outliers.Array) -> outliers.ImpactDetection:
        before = outliers.none_detected(len(t))
        return outliers.detect_outliers(before, off, LIMIT, DT, free)

    assert not found(off).suspect.any() and not found(off).in_impact.any()
    off[[800, 2400], 1] = KNOCK
    assert set(np.flatnonzero(found(off).in_impact)) == {800, 2400}


def test_rests_count_where_no_contacts_are_held_or_nothing_but_contacts() -> None:
    t, still = DT * np.arange(3000), np.zeros((3000, 4, 3))
    assert is_free([], t, still, MOVING).all()
    assert is_free([HeldContact(PINCH, 0.0, 30.0)], t, still, MOVING).all()
