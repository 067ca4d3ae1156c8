"""What a person sees who prints a model or a motion: a line."""

import numpy as np

import dynamics as dyn


def test_a_mechanism() -> None:
    push = dyn.Force("link 8", (1.0, "push", 0.0))
    tree = dyn.tree(range(-1, 7))
    names = ", ".join([f"link {i}" for i in range(1, 7)])
    assert repr(tree) == f"<Mechanism of 8 bodies, 8 coordinate(s) {names}, ...; gravity 0, 0, -9.81>"
    locked = {f"link {i}": 0.1 for i in range(3, 9)}
    two = dyn.Mechanism(tree.bodies, gravity=(0.0, 0.0, 0.0), forces=[push], locked=locked)
    assert repr(two) == (
        "<Mechanism of 8 bodies, 2 coordinate(s) link 1, link 2; "
        "locked link 3, link 4, link 5, link 6, link 7, link 8; forces on link 8; parameters push; gravity 0, 0, 0>"
    )


def test_a_trajectory() -> None:
    arm = dyn.planar_arm([1.0], [1.0])
    event = dyn.Event("bottom", lambda q, qd, t: q[0])
    run = dyn.simulate(arm, [0.1], [0.0], 2.0, "rk4", dt=0.5, events=event, estimate_error=False)
    said = "5 rows, t = 0 .. 2 s, 2 of event bottom; rk4, 4 steps, reached t_end; error not estimated>"
    assert repr(run) == f"<Trajectory of 1 coordinate(s): {said}"
    decay = dyn.OdeSystem(lambda x, t: [-x[0]], ["x"])
    run = dyn.simulate(decay, [1.0], None, 1.0, "rk4", dt=0.5, t_eval=[1.0], estimate_error=False)
    assert repr(run).endswith(" of 1 state(s): 1 row, t = 1 .. 1 s; rk4, 2 steps, reached t_end; error not estimated>")


def test_an_ensemble() -> None:
    arm = dyn.planar_arm([1.0], [1.0])
    runs = dyn.simulate_many(arm, np.zeros((3, 1)), np.ones((3, 1)), 0.5, t_eval=[0.0, 0.5], backend="python")
    assert repr(runs) == "<Ensemble of 3, 1 coordinate(s): 2 rows, t = 0 .. 0.5 s; dop853, 3 reached t_end>"
