from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from capture.standings import LOST_AFTER_S, Standing, StandingsWatch
from devices.frame import TrackerFrame
from devices.sample import ROLES
from reconstruction.tracking import footings

FRAME_S = 0.1


def watched(presence, held=False):
    """The standings after frames of that presence: rows of roles that are there."""
    watch, last = StandingsWatch(), None
    for number, roles in enumerate(presence):
        frame = TrackerFrame.from_positions(number * FRAME_S, dict.fromkeys(roles, (0.0, 1.0, 0.0)))
        last = watch.seen(frame, footings(frame, held and not roles))
    return last


def test_a_tracker_goes_from_measured_to_prior_to_lost_and_back():
    worn = ["root", "head"]
    gone = [worn] + [["root"]] * round(LOST_AFTER_S / FRAME_S)
    head = ROLES.index("head")
    assert watched([worn]).now[head] == Standing.MEASURED
    assert watched(gone[:5]).now[head] == Standing.PRIOR
    assert watched([*gone, ["root"]]).now[head] == Standing.LOST
    assert watched([*gone, worn]).now[head] == Standing.MEASURED
    assert watched(gone).now[ROLES.index("root")] == Standing.MEASURED


def test_without_any_tracker_the_pose_is_held():
    standings = watched([["root", "head"], [], []], held=True)
    assert standings.now[ROLES.index("head")] == Standing.HELD
    assert standings.now[ROLES.index("left_wrist")] == Standing.ABSENT


def test_who_was_never_seen_is_absent_and_counts_no_dropout():
    standings = watched([["root"]] * 50)
    others = [n for n, role in enumerate(ROLES) if role != "root"]
    assert (standings.now[others] == Standing.ABSENT).all()
    assert standings.dropouts.sum() == 0
    assert standings.missing_s.sum() == 0


@given(st.lists(st.booleans(), min_size=1, max_size=60))
def test_dropouts_are_the_ends_of_presence_and_their_time_is_what_was_missing(there):
    standings = watched([["root", *(["head"] if here else [])] for here in there])
    head = ROLES.index("head")
    first = there.index(True) if True in there else len(there)
    ends = sum(before and not now for before, now in pairwise(there))
    assert standings.dropouts[head] == ends
    assert np.isclose(standings.missing_s[head], FRAME_S * sum(not here for here in there[first:]))
