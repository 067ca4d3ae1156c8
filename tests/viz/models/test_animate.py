"""Animations: frames in real time, what is wrong in its color, and one sentence for what cannot be."""

import io
from dataclasses import replace

import numpy as np
import pytest

import dynamics as dyn
import viz
from dynamics import scenes
from tests.each_row import each_row
from viz.animation.panels import DARK, LIGHT
from viz.models.film import _at, frames

pytest.importorskip("matplotlib")
Image = pytest.importorskip("PIL.Image")
ARM = dyn.planar_arm([1.0, 0.5], [1.0, 0.8])
FALL = dyn.simulate(ARM, [1.0, 0.2], [0.0, 0.0], t_end=0.08)
SYSTEM = dyn.System(lambda q, qd, t: qd[0] ** 2 + qd[1] ** 2 - q[0] ** 2 - q[0] * q[1], "x y")
SWING = dyn.simulate(SYSTEM, [1.0, 0.2], [0.0, 0.0], t_end=0.08)


def opened(film: bytes):
    """The frames, and how long each is shown [s]."""
    with Image.open(io.BytesIO(film)) as file:
        shown = []
        for k in range(file.n_frames):
            file.seek(k)
            shown.append((np.asarray(file.convert("RGB")).astype(int), file.info["duration"] / 1000.0))
    return [frame for frame, _ in shown], [seconds for _, seconds in shown]


def has(frame, color: str) -> bool:
    """Whether a pixel has a color, or nearly."""
    wanted = np.array([int(color[i : i + 2], 16) for i in (1, 3, 5)])
    return bool((np.abs(frame - wanted).sum(axis=2) < 24).any())


@each_row(("model", "motion"), [(ARM, FALL), (SYSTEM, SWING)])
def test_a_film_takes_the_time_of_the_motion(model, motion, tmp_path):
    path = tmp_path / "film.gif"
    film = viz.animate(model, motion, path)
    assert path.read_bytes() == film
    found, seconds = opened(film)
    assert sum(seconds) == pytest.approx(0.12)  # 0.08 s, and the frame of the end
    assert len(found) == frames(0.08, 1.0) == 3
    assert np.ptp(found, axis=0).max() > 100


@pytest.mark.parametrize("dark", [False, True])
def test_two_side_by_side_and_the_wrong_one_in_its_color(dark):
    colors = DARK if dark else LIGHT
    film = viz.animate(ARM, {"a": FALL, "b": FALL}, marked=["a"], dark=dark, wanted=lambda t: np.zeros((len(t), 2)))
    found, _ = opened(film)
    left, right = np.array_split(found[-1], 2, axis=1)
    assert has(left, colors.wrong)
    assert not has(right, colors.wrong)
    assert has(right, colors.links[0])
    assert has(right, colors.faint)
    page = [int(colors.page[i : i + 2], 16) for i in (1, 3, 5)]
    assert left[0, 0].tolist() == page  # to the bit: it stands on such a page


def test_speed_and_a_motion_that_ends_early():
    short = dyn.simulate(ARM, [1.0, 0.2], [0.0, 0.0], t_end=0.04)
    found, seconds = opened(viz.animate(ARM, [FALL, short], speed=0.5))
    assert sum(seconds) == pytest.approx(0.2)
    left, right = zip(*[np.array_split(frame[:350], 2, axis=1) for frame in found], strict=True)
    assert np.abs(left[-1] - left[-2]).max() > 100
    assert np.abs(right[-1] - right[-2]).max() < 40  # each frame has colors of its own


def test_between_rows_a_motion_is_cubic():
    t = np.linspace(0.0, 0.2, 17)
    coarse = dyn.simulate(ARM, [1.0, 0.2], [0.0, 0.0], t_end=0.2, t_eval=[0.0, 0.1, 0.2])
    fine = dyn.simulate(ARM, [1.0, 0.2], [0.0, 0.0], t_end=0.2, t_eval=t)
    straight = np.interp(t, coarse.t, coarse.q[:, 0])
    assert np.abs(_at(coarse, t) - fine.q).max() < 3e-4 < 3e-3 < np.abs(straight - fine.q[:, 0]).max()
    assert (_at(coarse, np.array([-1.0, 9.0])) == coarse.q[[0, -1]]).all()
    back = dyn.simulate(ARM, coarse.q[-1], coarse.qd[-1], t_span=(0.2, 0.0))
    assert np.abs(_at(back, t) - fine.q).max() < 3e-4


def test_a_robot_that_flies_away_stays_in_the_frame():
    ball = dyn.Mechanism([dyn.Body("b", dyn.Joint("free"), mass=1.0, inertia=np.eye(3), center=(0.1, 0.0, 0.0))])
    start = scenes.of_model(ball)
    run = dyn.simulate(ball, start.q, start.qd, t_end=3.0)
    first, *_, last = opened(viz.animate(ball, run, speed=10.0))[0]
    middle = [frame[30:370] for frame in (first, last)]
    assert all((each != 255).any() for each in middle)
    assert (middle[0] != middle[1]).any()


@each_row("value", [0.0, 5e-324, -3.0, 1e20])
def test_what_stands_still_is_drawn(value):
    still = replace(SWING, q=np.full_like(SWING.q, value), qd=np.zeros_like(SWING.qd))
    assert len(opened(viz.animate(SYSTEM, still))[0]) >= 1
    with pytest.raises(ValueError, match=r"coordinates up to 1e\+308 are too large to be drawn"):
        viz.animate(SYSTEM, replace(still, q=np.full_like(SWING.q, 1e308)))


def test_a_notebook_plays_it():
    film = viz.animate(ARM, FALL)
    assert film._repr_html_().startswith('<img src="data:image/gif;base64,')


@each_row(
    ("arguments", "named", "message"),
    [
        (
            (SYSTEM, dyn.simulate(dyn.planar_arm([1.0], [1.0]), [1.0], [0.0], 0.1)),
            {},
            r"2 coordinate\(s\), motion '' has 1",
        ),
        ((ARM, []), {}, "1 to 4 motions side by side, got 0"),
        ((ARM, [FALL] * 5), {}, "1 to 4 motions side by side, got 5"),
        ((ARM, FALL), {"speed": 1e-9}, "at speed 1e-09 are 2e[+]09; speed 0.008 makes it 10 s long"),
        (
            (ARM, replace(FALL, t=FALL.t[:1], q=FALL.q[:1], qd=FALL.qd[:1])),
            {},
            "nothing to film: pass --t-end",
        ),
        ((ARM, FALL), {"speed": 1e9}, "a film has 2 to 1000 frames"),
        ((ARM, FALL, "film.avi"), {}, "a film's file must end in .gif, got 'film.avi'"),
        ((ARM, FALL), {"marked": ["a"]}, "there is no motion 'a'"),
        ((ARM, FALL), {"wanted": lambda t: t}, r"coordinates \(T, nq\) = \(9, 2\), got shape \(9,\)"),
    ],
)
def test_what_cannot_be_shown_is_told(arguments, named, message):
    with pytest.raises(ValueError, match=message):
        viz.animate(*arguments, **named)
