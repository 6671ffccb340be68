"""What goals make of the sliders, with a clock, a model and error bounds of the test's own."""

from dataclasses import replace

import pytest

from app.state import FrameReport, ViewerState
from app.steering import REST, Steering
from hierarchy.goals import Detail, Promise

SIZE = (320, 240)
FRAME = 0.03


class FakeScene:
    """Like a scene, equal to none but itself."""

    hierarchy = "a model"
    is_mesh = False


class Bounds:
    """Error bounds that depend on nothing but the tiles; counts how often they are asked for, and for which tiles.

    radii : r_inner by texels; the largest wins
    """

    def __init__(self):
        self.radii = {2: 2.0, 4: 4.0, 8: 8.0, 16: 16.0, 32: 17.0}
        self.asked = []

    def __call__(self, hierarchy, view, goal, *, texels):
        self.asked.append(tuple(texels))
        best = max(texels, key=self.radii.__getitem__)
        return Detail(goal.pixels, self.radii[best] * goal.degrees, best), Promise(0.9 * goal.degrees, goal.pixels)


@pytest.fixture
def bounds(monkeypatch):
    bounds = Bounds()
    monkeypatch.setattr("hierarchy.goals.detail_for_goal", bounds)
    return bounds


class Session:
    """A user at a window: one call is one turn of its loop."""

    def __init__(self, **fields):
        self.state = ViewerState(**fields)
        self.steering = Steering()
        self.scene, self.camera, self.now, self.missing = FakeScene(), object(), 100.0, 0
        self.update()

    def update(self, seconds=FRAME):
        self.now += seconds
        self.steering.update(self.state, self.scene, self.camera, SIZE, lambda: "a view", self.now)

    def move(self, milliseconds=None):
        """Move the camera and draw, which takes some time."""
        self.camera = object()
        self.update()
        self.draw(milliseconds)

    def draw(self, milliseconds=None):
        milliseconds = 100.0 / (self.steering.r_inner / 16.0) if milliseconds is None else milliseconds
        self.now += 1e-3 * milliseconds
        report = FrameReport(1, 2, 3, 4, (1.0, 1.0, 1.0, 1.0), milliseconds, self.missing, self.steering.texels)
        self.steering.drawn(self.state, report, self.now)

    @property
    def radii(self):
        return self.steering.r_sil, self.steering.r_inner


def test_without_goals_the_sliders_hold_and_nothing_is_waited_for(bounds):
    session = Session(r_sil=1.5, r_inner=20.0, texels=8)
    for _ in range(20):
        session.move(500.0)
        assert (session.radii, session.steering.texels) == ((1.5, 20.0), 8)
        assert session.steering.next_change is None
    assert bounds.asked == []


def test_rate_coarsens_what_moves_and_rest_refines_it(bounds):
    session = Session(hold_rate=True, frames_per_second=30.0)
    for _ in range(30):
        session.move()
    r_sil, r_inner = session.radii
    assert r_inner == pytest.approx(16.0 * 3.0, rel=0.2)
    assert r_sil == pytest.approx(2.0 * r_inner / 16.0)
    assert session.state.steered.coarseness == pytest.approx(r_inner / 16.0)
    # The window has to look again once the camera rests, and not after that.
    assert session.steering.next_change == pytest.approx(session.now + REST)
    session.update(REST - 0.01)
    assert session.radii == (r_sil, r_inner)
    session.update(0.02)
    seen = []
    while session.radii != (2.0, 16.0):
        seen.append(session.radii[1])
        session.draw()
        session.update()
    assert seen == pytest.approx([r_inner / 2.0])
    assert session.steering.next_change is None
    session.draw(1000.0)
    assert session.state.steered.coarseness == pytest.approx(r_inner / 16.0)
    session.move()
    assert session.radii[1] == pytest.approx(r_inner)


def test_slow_frame_of_a_motion_is_no_rest(bounds):
    session = Session(hold_rate=True, frames_per_second=5.0)
    seen = []
    for _ in range(10):
        session.move(2.0 * 1e3 * REST)
        # The next event is still on its way.
        session.update(0.01)
        seen.append(session.radii[1])
    assert seen == sorted(seen)
    assert seen[-1] > 2.0 * seen[0]


def test_frames_of_settings_scenes_and_rest_are_not_measured(bounds):
    session = Session(hold_rate=True)
    for _ in range(10):
        session.move(10.0)
    for change in ("printed_cone_test", "settings", "scene", "nothing"):
        for _ in range(8):
            if change == "printed_cone_test":
                session.state.printed_cone_test = not session.state.printed_cone_test
            elif change == "settings":
                ground = session.state.settings.ground
                session.state.settings = replace(session.state.settings, ground=not ground)
            elif change == "scene":
                session.scene = FakeScene()
            if change != "nothing":
                session.camera = object()
            session.update()
            session.draw(900.0)
        assert session.state.steered.coarseness == 1.0, change


def test_error_goal_gives_radii_and_tiles(bounds):
    session = Session(limit_error=True, max_degrees=0.5, max_pixels=0.4, r_sil=9.0, r_inner=9.0)
    assert session.radii == (0.4, 8.5)
    session.draw()
    steered = session.state.steered
    assert (steered.r_sil, steered.r_inner, steered.texels, steered.promise) == (0.4, 8.5, 32, (0.45, 0.4))
    session.state.limit_error = False
    session.update()
    assert session.radii == (9.0, 9.0)
    assert session.state.steered.promise is None


def test_bounds_are_followed_now_and_then_while_moving_and_once_at_rest(bounds):
    session = Session(limit_error=True)
    session.update(1.0)
    bounds.asked.clear()
    for _ in range(50):
        session.move(1e3 * FRAME)
    # 50 moves in 3 seconds, with the tiles that there are.
    assert 8 <= len(bounds.asked) <= 13
    assert set(bounds.asked) == {(32,)}
    assert session.steering.next_change is not None
    session.update(2.0 * REST)
    assert bounds.asked[-3:] == [(2, 4, 8, 16, 32), (32,), (32,)]
    assert session.steering.next_change is None
    bounds.asked.clear()
    for _ in range(10):
        session.update(1.0)
    assert bounds.asked == []


def test_changed_goal_is_followed_at_once(bounds):
    session = Session(limit_error=True, max_degrees=1.0)
    session.update(1.0)
    session.state.max_degrees = 0.5
    session.update(0.01)
    assert session.radii[1] == 8.5


@pytest.mark.parametrize(("present", "radii", "wanted"), [
    # 17 instead of 16 pixels are not worth a bake, eight times the radius is; what is there stays, however large.
    (16, {}, 16),
    (2, {}, 32),
    (32, {2: 17.0, 32: 16.0}, 32),
])  # fmt: skip
def test_tiles_change_only_for_much_better_ones_and_only_at_rest(bounds, present, radii, wanted):
    bounds.radii[present] = 100.0
    session = Session(limit_error=True)
    assert session.steering.texels == present
    bounds.radii.update({2: 2.0, 16: 16.0, 32: 17.0, **radii})
    session.move()
    assert session.steering.texels == present
    session.update(2.0 * REST)
    for _ in range(5):
        assert session.steering.texels == wanted
        assert session.radii[1] == bounds.radii[wanted]
        session.update(1.0)


def test_what_is_promised_counts_on_all_tiles_being_there(bounds):
    session = Session(limit_error=True)
    assert session.state.steered.promise is None
    session.missing = 3
    session.draw()
    assert session.state.steered.promise is None
    session.missing = 0
    session.draw()
    assert session.state.steered.promise is not None
    session.state.settings = replace(session.state.settings, normal_mapping=False)
    session.update()
    assert session.state.steered.promise is None


def test_both_goals_together(bounds):
    session = Session(limit_error=True, max_degrees=0.5, hold_rate=True, frames_per_second=30.0)
    for _ in range(40):
        session.move(60.0 * 8.5 / session.steering.r_inner)
    assert session.radii[1] == pytest.approx(8.5 * session.state.steered.coarseness)
    assert session.state.steered.coarseness == pytest.approx(2.0, rel=0.2)
    assert session.state.steered.r_inner == 8.5
    for _ in range(8):
        session.update(REST)
        session.draw(1.0)
    session.update(REST)
    assert session.radii == (0.5, 8.5)


def test_a_mesh_with_tiles_is_blended_at_rest_only():
    session = Session()
    session.scene.is_mesh = True
    session.draw()
    # It has not moved: what has just been opened is blended from the first frame on.
    session.update()
    assert session.steering.blends
    session.move()
    assert not session.steering.blends
    assert session.steering.next_change == pytest.approx(session.now + REST)
    session.update(REST - 0.01)
    assert not session.steering.blends
    session.update(0.02)
    assert session.steering.blends
    assert session.steering.next_change is None


@pytest.mark.parametrize("hold_rate", [True, False])
def test_an_error_that_is_promised_of_what_moves_is_that_of_blended_splats(bounds, hold_rate):
    session = Session(limit_error=True, hold_rate=hold_rate)
    session.scene.is_mesh = True
    session.draw()
    session.move()
    assert session.steering.blends != hold_rate


@pytest.mark.parametrize("lacks", ["tiles", "normal mapping", "triangles"])
def test_without_tiles_or_triangles_what_moves_is_blended(lacks):
    session = Session(texels=0 if lacks == "tiles" else 16)
    session.scene.is_mesh = lacks != "triangles"
    session.state.settings = replace(session.state.settings, normal_mapping=lacks != "normal mapping")
    for _ in range(3):
        session.move()
        assert session.steering.blends
