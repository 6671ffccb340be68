"""The controller against simulated loads: t = a + b / s^p with noise, outliers, jumps and cliffs."""

import math
import random
from itertools import pairwise
from statistics import median

import pytest

from app.budget import MAX_COARSENESS, Budget, Controller, coarsened

GOAL = 33.0
SEEDS = range(12)


def simulate(cost, frames, *, noise=0.0, seed=0, slow=()):
    """Let a controller run; return for each frame the coarseness and the time without noise over the goal.

    cost : milliseconds from coarseness and frame number
    noise : the times measured are off by at most this share
    slow : frames that take five times as long
    """
    chance, controller, run = random.Random(seed), Controller(GOAL), []
    for frame in range(frames):
        time = cost(controller.coarseness, frame)
        run.append((controller.coarseness, time / GOAL))
        controller.measure(time * (1.0 + chance.uniform(-noise, noise)) * (5.0 if frame in slow else 1.0))
    return run


def power(p, overload, fixed=0.2):
    """Return a cost that is `overload` times the goal in full detail, a share of it whatever the detail."""
    return lambda s, frame: GOAL * overload * (fixed + (1.0 - fixed) / s**p)


def changes(run):
    return sum(one[0] != other[0] for one, other in pairwise(run))


def frames_until(run, holds):
    """Return after how many frames something holds for five in a row."""
    return next(i for i in range(len(run) - 5) if all(holds(*frame) for frame in run[i : i + 5]))


def near_goal(_coarseness, time):
    return 0.7 <= time <= 1.15


LOADS = [(0.3, 1.3), (0.5, 1.3), (0.5, 2.0), (1.0, 1.3), (1.0, 2.0), (1.5, 4.0), (2.0, 1.3), (2.0, 2.0), (2.0, 4.0)]


@pytest.mark.parametrize(("p", "overload"), LOADS)
def test_steady_load_is_met_within_ten_frames_and_then_left_alone(p, overload):
    run = simulate(power(p, overload), 200)
    assert frames_until(run, near_goal) <= 10
    assert changes(run[20:]) == 0


@pytest.mark.parametrize(("p", "overload"), LOADS)
@pytest.mark.parametrize(("noise", "most_frames", "most_changes"), [(0.2, 12, 2), (0.5, 15, 5)])
def test_noise_hardly_moves_it(p, overload, noise, most_frames, most_changes):
    runs = [simulate(power(p, overload), 300, noise=noise, seed=seed) for seed in SEEDS]
    assert median(frames_until(run, near_goal) for run in runs) <= most_frames
    late = [run[100:] for run in runs]
    assert max(changes(run) for run in late) / 2.0 <= most_changes
    assert sum(near_goal(*frame) for run in late for frame in run) >= 0.97 * 200 * len(runs)


@pytest.mark.parametrize("noise", [0.0, 0.2])
def test_single_slow_frames_cost_no_detail(noise):
    def met(s, frame):
        return 0.8 * GOAL / s

    for seed in SEEDS:
        assert (
            simulate(met, 200, noise=noise, seed=seed, slow=(0, 50, 100, 101 + 20)) == [(1.0, pytest.approx(0.8))] * 200
        )


def test_slow_frames_at_a_held_rate_change_nothing():
    run = simulate(power(1.0, 2.0), 300, slow=(60, 120, 180))
    assert changes(run[40:]) == 0


@pytest.mark.parametrize("noise", [0.0, 0.3, 0.5])
def test_goal_that_is_always_met_keeps_full_detail(noise):
    for seed in SEEDS:
        run = simulate(lambda s, frame: 0.6 * GOAL / s, 200, noise=noise, seed=seed)
        assert {coarseness for coarseness, _ in run} == {1.0}


@pytest.mark.parametrize("noise", [0.0, 0.5])
def test_goal_out_of_reach_ends_at_the_coarsest(noise):
    for seed in SEEDS:
        run = simulate(lambda s, frame: GOAL * (1.6 + 1.0 / s), 200, noise=noise, seed=seed)
        assert max(coarseness for coarseness, _ in run) == MAX_COARSENESS
        assert changes(run[60:]) == 0


def test_lowers_at_once_and_raises_slowly():
    """The load doubles at frame 100 and falls to a third at frame 200."""

    def cost(s, frame):
        return (5.0 + 40.0 / s) * (2.0 if 100 <= frame < 200 else 2.0 / 3.0 if frame >= 200 else 1.0)

    for noise, at_once, least, most in ((0.0, 4, 8, 40), (0.3, 15, 8, 80)):
        for seed in SEEDS:
            run = simulate(cost, 400, noise=noise, seed=seed)
            assert frames_until(run[100:], lambda _, time: time <= 1.3) <= at_once
            assert least <= frames_until(run[200:], lambda s, time: time >= 0.7 or s == 1.0) <= most
            assert changes(run[320:]) <= 4


def test_raises_by_little_at_a_time():
    controller = Controller(GOAL)
    controller.coarseness = 8.0
    seen = [8.0]
    while controller.coarseness > 1.0:
        controller.measure(0.1 * GOAL)
        if controller.coarseness != seen[-1]:
            seen.append(controller.coarseness)
    assert all(1.0 < one / other <= math.sqrt(2.0) + 1e-9 for one, other in pairwise(seen))
    assert seen[-1] == 1.0


@pytest.mark.parametrize("noise", [0.0, 0.3])
def test_cliff_is_not_walked_up_and_down(noise):
    """No coarseness meets the goal closely: one side is much too slow, the other much too fast."""
    for seed in SEEDS:
        run = simulate(lambda s, frame: 20.0 if s > 2.0 else 50.0, 1000, noise=noise, seed=seed)
        late = run[200:]
        assert sum(time > 1.1 for _, time in late) <= 0.05 * len(late)
        assert changes(late) <= 0.03 * len(late)


def test_no_goal_is_full_detail():
    controller = Controller(GOAL)
    for _ in range(10):
        controller.measure(10.0 * GOAL)
    assert controller.coarseness > 2.0
    controller.set_goal(None)
    controller.measure(10.0 * GOAL)
    assert controller.coarseness == 1.0


def test_other_goal_starts_from_where_it_is():
    controller = Controller(GOAL)
    for _ in range(20):
        controller.measure(2.0 * GOAL / controller.coarseness)
    assert controller.settled
    held = controller.coarseness
    controller.set_goal(0.5 * GOAL)
    assert (controller.coarseness, controller.settled) == (held, False)
    for _ in range(40):
        controller.measure(2.0 * GOAL / controller.coarseness)
    assert controller.coarseness == pytest.approx(2.0 * held, rel=0.2)


def test_times_that_are_none_are_left_out():
    controller = Controller(GOAL)
    for time in (0.0, -1.0, math.nan):
        controller.measure(time)
    assert (controller.coarseness, controller.settled) == (1.0, False)


def moving_budget():
    """Return a budget whose camera moves at twice the time that a frame may take."""
    budget = Budget()
    budget.controller.set_goal(GOAL)
    for _ in range(20):
        budget.update(moved=True, rests=False)
        budget.drawn(6.0 * GOAL / budget.coarseness, measured=True)
    assert budget.coarseness > 4.0
    return budget


def test_rest_refines_frame_by_frame_to_full_detail():
    budget = moving_budget()
    held = budget.coarseness
    # It stands still, but not for long enough yet.
    budget.update(moved=False, rests=False)
    assert budget.coarseness == held
    seen = []
    budget.update(moved=False, rests=True)
    while budget.coarseness > 1.0:
        seen.append(budget.coarseness)
        budget.drawn(10.0 * GOAL, measured=False)
        budget.update(moved=False, rests=True)
    assert seen == pytest.approx([held / 2.0**i for i in range(1, len(seen) + 1)])
    assert budget.coarseness == 1.0


def test_motion_resumes_where_it_was_held():
    budget = moving_budget()
    held = budget.controller.coarseness
    budget.update(moved=False, rests=True)
    for _ in range(10):
        # Frames in full detail, and others that only change settings, take long and tell nothing.
        budget.drawn(20.0 * GOAL, measured=False)
    budget.update(moved=True, rests=False)
    assert budget.coarseness == held
    budget.drawn(GOAL, measured=False)
    assert budget.controller.coarseness == held


def test_every_radius_grows_and_full_detail_changes_none():
    for radius in (0.0, 0.3, 1.0, 2.0, 16.0):
        assert coarsened(radius, 1.0) == radius
        assert coarsened(radius, 4.0) > coarsened(radius, 2.0) > coarsened(radius, 1.0)
    assert coarsened(2.0, 3.0) == 6.0
