"""Figures 4 and 5: the three-link arm in free fall, by our graph and by MuJoCo."""

import numpy as np

from cgraph._shared import Array, Json
from dynamics import Trajectory, inverse_dynamics, scenes, simulate
from dynamics.io.mujoco_twin import MujocoTwin
from dynamics.multibody.trees.mechanism import require_mechanism
from dynamics.scenes import Scene

from .. import theme
from ..pages.document import Block, Markup, Paragraph, Table
from ..plots import plot
from .part import Part, plotted

SNAPSHOTS, WINDOWS = 6, 6  # pictures, and rows of the table
SHOWN = 8  # steps from one point of the residual to the next
FRAME = 20  # steps from one picture of the moving figure to the next
PIXELS = 100  # of its picture, in a meter


def figures4_and_5() -> Part:
    """Figures 4 and 5: the three-link arm in free fall, by our graph and by MuJoCo."""
    scene = scenes.load("triple_pendulum")
    run = simulate(scene, scene.q, scene.qd, scene.t_end, "rk4", dt=1e-3)
    if not run.stats.success:
        raise RuntimeError(f"the fall of {scene.name} is not whole: it {run.stats.message}")
    positions = require_mechanism(scene, "a fall").joint_positions(run.q)
    instants = np.linspace(0.0, scene.t_end, SNAPSHOTS)
    ours = plot.snapshots(run.t, positions, instants.tolist())
    start = ", ".join(f"{angle:.4g}" for angle in scene.q)
    caption4 = (
        "Figure 4. The three-link arm in free fall (Section 3), by the Runge-Kutta method of order 4 on the equations of motion "
        f"from its own graph, with the path of each joint. Start at rest at θ = ({start}) rad, dt = 0.001 s."
    )
    tip = positions[[int(np.abs(run.t - t).argmin()) for t in instants], -1]
    path = "; ".join(
        [f"({letter}) {x:.2f}, {y + 0.0:.2f} m".replace("-", "−") for letter, (x, y) in zip("abcdef", tip, strict=True)]
    )
    seen = f"Six poses of an arm of three links, (a) at t = 0 to (f) at t = {scene.t_end:g} s"
    blocks: list[Block] = [plotted("fig4", ours, caption4, f"{seen}. The tip is at {path}.")]
    heading = "Figures 4 and 5: the three-link arm falls"
    data: dict[str, Json] = {"q_end": run.q[-1].tolist()}
    try:
        twin = MujocoTwin(scene.model, scene.t_end / (len(run.t) - 1))
    except ImportError as error:
        blocks.append(Paragraph(f"Figure 5 is missing on this machine. {error}", warning=True))
        moving, moves = _moving(scene, run, positions, None)
        return Part("fall", heading, [moving, *blocks], {"fall": data | {"mujoco": None}}, moves=moves)

    version = str(twin.mujoco.__version__)
    q, _ = twin.trajectory(np.array(scene.q), np.array(scene.qd), len(run.t) - 1)
    theirs = plot.snapshots(run.t, positions, instants.tolist(), dots=twin.arm_positions(q))
    caption5 = (
        f"Figure 5. The same arm in MuJoCo {version} (Section 4.1; the same method and step), as dots, over ours, as lines: joints "
        "at the same instants, and their paths."
    )
    apart = np.abs(run.q - q)
    ends = np.linspace(0, len(apart) - 1, WINDOWS + 1).astype(int)[1:]
    differences = [(float(run.t[k]), float(apart[: k + 1].max())) for k in ends]
    most = differences[-1][1]
    residual = (
        f"Figure 5, the residual: what our angles differ from MuJoCo's, joint by joint, at every {SHOWN}th step. The largest of all is {most:.1e} rad. "
        "It is rounding, which the motion makes grow; where a point is missing the angles are equal to the last bit."
    )
    header = ("up to t [s]", "largest |difference in θ| [rad]")
    rows = [(f"{t:.2f}", f"{difference:.2e}") for t, difference in differences]
    shown = np.where(apart > 0.0, apart, np.nan)[::SHOWN]
    errors = plot.over_time(run.t[::SHOWN], shown, "|Δθ| [rad]", theme.LINKS)
    grows = f"Differences of three joint angles over time, from {differences[0][1]:.0e} rad up to {differences[0][0]:g} s to {most:.0e} rad."
    blocks += [
        plotted("fig5", theirs, caption5, f"{seen}, with a dot of MuJoCo's on every joint and on its path."),
        plotted("fig5-residual", errors, residual, grows),
        Table("Our trajectory and MuJoCo's", header, rows, folded=True, file="fig5"),
        Paragraph(
            "Both integrate by the classical Runge-Kutta method with the same step, so what differs is the equations of motion: "
            "ours from a Lagrangian by automatic differentiation, MuJoCo's from its composite-rigid-body algorithm."
        ),
    ]
    data |= {"mujoco": version, "largest_difference": most}
    moving, moves = _moving(scene, run, positions, twin.arm_positions(q))
    return Part("fall", heading, [moving, *blocks], {"fall": data}, moves=moves)


def torque_at_rest(scene: Scene, formulation: str) -> float:
    """The largest torque that a formulation says holds the arm at rest where its fall starts [N m]."""
    graph = inverse_dynamics(scene, formulation)
    at = {f"q{i}{old}": angle for i, angle in enumerate(scene.q) for old in ("", "_old")} | {"dt": 1e-3}
    torques = graph.evaluate({name: at.get(name, 0.0) for name in graph.input_names})
    return max([abs(float(torque)) for torque in torques.values()])


def _moving(scene: Scene, run: Trajectory, ours: Array, theirs: Array | None) -> tuple[Markup, dict[str, Json]]:
    """The fall as a figure that moves, and what its script reads.

    ours, theirs: (T, 4, 2) positions of the joints [m].
    """
    frames = [np.round(each[::FRAME].reshape(-1, 8), 4).tolist() if each is not None else [] for each in (ours, theirs)]
    held, right = (torque_at_rest(scene, name) for name in ("by_definition", "chain_rule"))
    low, high = float(ours[..., 1].min()), float(ours[..., 1].max())
    reach = float(np.abs(ours[..., 0]).max())
    box = [PIXELS * each for each in (-reach - 0.1, -high - 0.2, 2 * reach + 0.2, high - low + 0.4)]
    tip = PIXELS * ours[0, -1]
    still = f'<path class="still" d="M0 0L{tip[0]:.0f} {-tip[1]:.0f}"/>' * (held == 0.0)
    stays = (
        f"By definition the arm stays where it is let go, the dashed line: at rest the torque that holds it is {held:g} N m "
        f"in place of {right:.3g} N m, so it weighs nothing."
    ) * (held == 0.0)
    dots = " MuJoCo's joints are the dots." * (theirs is not None)
    caption = f"Figures 4 and 5 as they move, with the path of the tip.{dots} {stays}"
    last = len(frames[0]) - 1
    markup = (
        f'<figure class="moving"><svg viewBox="{" ".join([f"{each:.0f}" for each in box])}" role="img" '
        f'aria-label="The falling arm at the time of the slider"><path id="trail"/>{still}<g id="arm"></g><g id="dots"></g></svg>'
        '<p class="step"><button id="run" type="button">Let it fall</button><label for="time">t</label>'
        f'<input id="time" type="range" min="0" max="{last}" value="{last * 2 // 5}" step="1"><output for="time"></output></p>'
        f"<figcaption>{caption}</figcaption></figure>"
    )
    dt = float(run.t[FRAME] - run.t[0])
    return Markup(markup, caption), {"motion": {"dt": dt, "ours": frames[0], "theirs": frames[1]}}
