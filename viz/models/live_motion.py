"""The page on which a model moves live: computed in the page, as it is watched."""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

import cgraph as cg
import dynamics as dyn
from cgraph import Graph, Node
from cgraph._shared import write_files
from dynamics import scenes
from dynamics.equations.momentum.hamiltonian import velocities
from dynamics.equations.state_equation import state_inputs
from dynamics.integrators import TABLEAUS, derive, in_form
from dynamics.integrators.rate_in_modes import switched
from dynamics.multibody.bodies.joint_coordinates import display_units
from dynamics.multibody.trees.joint_positions import contact_surfaces, drawn_points, view
from dynamics.scenes.start import Start, moving_start, with_start
from dynamics.systems.model import Model

from ..live_page.live_panel import Live, page_text, panel
from ..pages.html import Page, Panel, html_target

MOST_BODIES = 4  # of a mechanism whose masses become parameters by themselves
SAMPLES = 16  # states at which the extent of a mechanism is looked at
MOST_STEPS = 1000  # of the motion by which dt is chosen
NOTES = {
    "torque": "holding: the torque or force that keeps it at rest here against gravity and springs. "
    "dp/dt: the rate of the momentum p.",
    "rate": "of the state, as the equations have them",
    "side": "which side of each surface holds on which the rate jumps or kinks: -1 or 1, or n of a floor. The steps of "
    "this page go across, so that nothing sticks; those of cgraph simulate end there, and what should stick does.",
}
USUAL = {"rad": math.pi, "rad/s": 10.0}  # how far sliders reach at least; 1 of all else
SHARE = 0.25  # of the steps that a method of order 5 chooses


def live(model: Model, path: str | os.PathLike[str] | None = None, *, start: Start | None = None) -> Page:
    """The page on which a model moves as it is watched, computed there: one HTML file that loads nothing.

    Sliders and fields set the state, the torques, the parameters and dt; of a small mechanism without parameters,
    masses and gravity are some. Meters show energies, momenta, torques and the error of the steps; beside the motion
    is the same one by much shorter steps. A link holds the whole state.

    Parameters
    ----------
    model : Model
        A System, a Mechanism, an OdeSystem or a Scene; of the state of first order it shows the course over time.
    path : str or path, optional
        The file to write the page to, .html.
    start : mapping of str to float, or sequence of float, optional
        As `viz.inspect` takes it: {name: value} of what differs from the model's start [rad or m, per second]; where
        that would rest, or has no rates, by default one that shows something.

    Returns
    -------
    Page
        The HTML text; a notebook shows it in a frame.

    Raises
    ------
    TypeError
        For what is no model.
    ValueError
        For a path that does not end in .html, or a start that does not fit.
    OSError
        For a path that cannot be written.

    Examples
    --------
    >>> import dynamics as dyn
    >>> import viz
    >>> page = viz.live(dyn.planar_arm([1.0], [1.0]), start={"joint 1": 1.0})
    >>> len(page.encode()) < 50_000
    True
    """
    target = html_target("the page's file", path)
    scene = scenes.of_model(model)
    scene = moving_start(scene) if start is None else with_start(scene, start)
    text = page_text(live_of(scene), title=f"{scene.name}, live", about=scene.about)
    if target is not None:
        write_files({target: text})
    return text


def live_panel(scene: dyn.Scene, *, momentum: bool = False) -> Panel:
    """The motion of a scene as a view of the inspector, computed from when its tab is first opened."""
    shown = panel(live_of(scene, momentum=momentum), begin='inspector.onView("live", startLive);')
    section = f'<section id="live" role="tabpanel" aria-label="live" hidden>\n{shown.body}</section>'
    return shown._replace(body="", end=section)


def live_of(scene: dyn.Scene, *, momentum: bool = False) -> Live:
    """The panel's content for a scene. Masses and gravity of a small mechanism without parameters become parameters.

    momentum: the state is coordinates and momenta.  The step at first is one that is short enough.

    Raises as `state_equation`, `hamilton_equations` and `simulate` do.
    """
    scene = adjustable(scene)
    if scene.ode is not None:
        return _first_order(scene)
    rate = dyn.hamilton_equations(scene.model) if momentum else dyn.state_equation(scene.model)
    known = state_inputs(scene.model)
    values = dict(zip(known.states, (*scene.q, *scene.qd), strict=True)) | known.parameters
    values |= _momenta(scene, values) if momentum else {}
    start = {name: values.get(name, 0.0) for name in rate.input_names}  # torques and the time are 0
    outputs, meters = _meters(scene, rate)
    sides, of_sides = _sides(scene, "momentum" if momentum else "velocity")
    outputs, meters = outputs | sides, meters + of_sides
    places_, parents, radii = _places(scene, rate, start)
    shown = cg.simplify(Graph(rate.inputs, outputs | places_))
    units = {} if scene.mechanism is None else display_units(scene.mechanism.moving)
    units |= {name: "kg" for name in start if name.startswith("mass.")} | {"g": "m/s²", "t": "s"}
    torques = [abs(float(value)) for name, value in shown.evaluate({**start}).items() if name.startswith("gravity")]
    weight = max(filter(math.isfinite, torques), default=0.0)  # none at a center that attracts
    scales = {name: _scale(name, value, units.get(name, ""), weight) for name, value in start.items()}
    if momentum:
        usual = {f"qd{i}": USUAL.get(units.get(f"qd{i}", ""), 1.0) for i in range(scene.system.n)}
        reach = {name: abs(p) for name, p in _momenta(scene, values | usual).items()}
        scales |= {name: _round(p) for name, p in reach.items() if 0.0 < p < math.inf}  # of speeds that are none, NaN
    names, limits = dyn.display_names(scene), _limits(scene)
    return Live(rate, start, shown, meters, parents, scales, _step(scene), TABLEAUS, names, units, NOTES, limits, radii)


def adjustable(scene: dyn.Scene) -> dyn.Scene:
    """The scene that the page computes: of a small mechanism without parameters, masses and gravity are some.

    Inertias are in proportion to the masses.
    """
    mechanism = scene.mechanism
    if mechanism is None:
        return scene
    numbers = [*[body.mass for body in mechanism.bodies], *np.ravel(np.array(mechanism.gravity, dtype=object))]
    if mechanism.parameters or len(mechanism.moving) > MOST_BODIES or not all(map(_is_number, numbers)):
        return replace(scene, model=mechanism)
    gravity = np.array(mechanism.gravity, dtype=np.float64)
    size = float(np.linalg.norm(gravity))
    bodies, parameters = [], {"g": size} if size else {}
    for body in mechanism.bodies:
        inertia = np.array(body.inertia, dtype=object)
        name = f"mass.{'_'.join(body.name.split())}"
        if body.mass and name not in parameters and all(map(_is_number, inertia.ravel())):
            mass, parameters[name] = cg.variable(name), float(body.mass)
            scaled = [[each and each / body.mass * mass for each in row] for row in np.atleast_2d(inertia)]
            body = replace(body, mass=mass, inertia=scaled if inertia.ndim == 2 else scaled[0])
        bodies.append(body)
    down = [float(part / size) * cg.variable("g") if part else 0.0 for part in gravity]
    adjusted = replace(mechanism, bodies=bodies, gravity=down if size else mechanism.gravity, parameters=parameters)
    return replace(scene, model=adjusted)


def _limits(scene: dyn.Scene) -> dict[str, tuple[float, float]]:
    """{input: where its slider ends}: the joints' limits of position, velocity and effort."""
    places = {name: k for k, name in enumerate(scene.velocities)}
    found = {f"q{k}": each.position for k, each in enumerate(scene.limits.values())}
    for name, each in scene.limits.items():
        if name in places:
            found |= {f"qd{places[name]}": each.velocity, f"tau{places[name]}": each.effort}
    return found


def _first_order(scene: dyn.Scene) -> Live:
    """The panel's content for a system of first order: its state over time, and its rates."""
    rate = dyn.state_equation(scene)
    values = dict(zip(scene.coordinates, scene.q, strict=True)) | dict(scene.parameters)
    start = {name: float(values.get(name, 0.0)) for name in rate.input_names}  # the time is 0
    sides, of_sides = _sides(scene)
    meters = [*[(f"d {name}/dt", "", "rate") for name in scene.coordinates], *of_sides]
    shown = Graph(rate.inputs, rate.outputs | sides)
    return Live(rate, start, shown, meters, dt=_step(scene), methods=TABLEAUS, units={"t": "s"}, notes=NOTES)


def _sides(scene: dyn.Scene, form: str = "velocity") -> tuple[dict[str, Node], list[tuple[str, str, str]]]:
    """The sides of surfaces on which the rate jumps or kinks, and their meters."""
    switches = switched(in_form(derive(scene, {}), form)).switches
    if switches is None:
        return {}, []
    return {f"side{k}": each for k, each in enumerate(switches.sides)}, [(each, "", "side") for each in switches.words]


def _is_number(value: object) -> bool:
    return not isinstance(value, (Node, str))


def _meters(scene: dyn.Scene, rate: Graph) -> tuple[dict[str, Node], list[tuple[str, str, str]]]:
    """Energies, momenta and torques over the inputs of the rate."""
    system = scene.system
    inputs = dict(zip(rate.input_names, rate.inputs, strict=True))
    momenta = "p0_dot" in rate.outputs
    if momenta:
        moved = velocities(system)
        inputs |= moved(**{name: inputs[name] for name in moved.input_names})
    else:
        inputs |= {f"qdd{i}": rate.outputs[f"qd{i}_dot"] for i in range(system.n)}
    called, units = dyn.display_names(scene), {} if scene.mechanism is None else display_units(scene.mechanism.moving)

    def over(graph: Graph) -> dict[str, Node]:
        return graph(**{name: inputs[name] for name in graph.input_names})

    (kinetic,) = over(dyn.kinetic_energy(system)).values()
    (potential,) = over(dyn.potential_energy(system)).values()
    outputs = {"kinetic": kinetic, "potential": potential, "energy": kinetic + potential}
    meters = [(name, "J", "energy") for name in outputs]
    rates = {kind: {name: node for name, node in rate.outputs.items() if name[0] == kind} for kind in "qp"}
    groups = {
        "velocity" if momenta else "momentum": rates["q"] if momenta else over(dyn.momentum(system)),
        "torque": over(dyn.gravity_force(system)),
        "rate": rates["p"] if momenta else over(dyn.momentum_rate(system)),
    }
    for group, nodes in groups.items():
        for name, node in nodes.items():
            outputs[name] = node
            shown = called.get(name, name).replace("p_dot", "dp/dt").replace("gravity", "holding")
            meters.append((shown, units.get(name, ""), "torque" if group == "rate" else group))
    return outputs, meters


def _momenta(scene: dyn.Scene, values: Mapping[str, float]) -> dict[str, float]:
    """p0.. at a state (q, qd)."""
    graph = dyn.momentum(scene.system)
    found = graph.evaluate({name: values.get(name, 0.0) for name in graph.input_names})
    return {name: float(value) for name, value in found.items()}


def _places(
    scene: dyn.Scene, rate: Graph, start: dict[str, float]
) -> tuple[dict[str, Node], tuple[int, ...], tuple[float, ...]]:
    """Places of joints and tips in the picture, x0, y0, x1, .. over the inputs of the state equation, and parents.

    Then come points of the surfaces of contacts; and the radii of their spheres.
    """
    if scene.mechanism is None:
        return {}, (), ()
    inputs = dict(zip(rate.input_names, rate.inputs, strict=True))
    marks, touching = drawn_points(scene.mechanism), contact_surfaces(scene.mechanism.forces)
    seen = [*[(body, at) for body, at, _ in marks], *touching.points]
    graphs = [scene.mechanism.position(body, at) for body, at in seen]
    turns = np.linspace(0.0, 3.0, SAMPLES)
    at = {name: start[name] + np.sin((k + 2.0) * turns) for k, name in enumerate(start)}
    points = []
    for graph in graphs[: len(marks)]:
        found = graph.evaluate({name: at[name] for name in graph.input_names})
        points.append(np.stack([np.broadcast_to(found[axis], SAMPLES) for axis in "xyz"], axis=-1))
    sides = view(np.stack(points))
    outputs = {}
    for k, graph in enumerate(graphs):
        nodes = [*graph(**{name: inputs[name] for name in graph.input_names}).values()]
        for name, side in zip("xy", sides, strict=True):
            terms = [float(part) * node for part, node in zip(side, nodes, strict=True) if part]
            outputs[f"{name}{k}"] = sum(terms[1:], start=terms[0])
    return outputs, tuple([parent for _, _, parent in marks]), touching.radii


def _scale(name: str, value: float, unit: str, weight: float) -> float:
    """Reach of a slider to both sides of 0."""
    if name.startswith("tau"):
        return _round(2.0 * weight) if weight else 10.0
    usual = USUAL.get(unit, 1.0)
    return max(usual, 3.0 * abs(value)) if name[:1] == "q" else 3.0 * abs(value) or 1.0


def _round(value: float) -> float:
    """The next of 1, 2, 5, 10, .. that is not below."""
    power = 10.0 ** math.floor(math.log10(value))
    return next(each * power for each in (1.0, 2.0, 5.0, 10.0) if each * power >= value)


def _step(scene: dyn.Scene) -> float:
    """A step that is short enough: a share of those that an adaptive method takes at first, rounded."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", dyn.SimulationWarning)  # the page shows what equal steps do to a stiff system
        qd = None if scene.ode is not None else scene.qd
        run = dyn.simulate(scene, scene.q, qd, min(scene.t_end, 1.0), "dopri5", rtol=1e-4, max_steps=MOST_STEPS)
    steps = np.diff(run.t)
    usual = float(np.median(steps)) if run.stats.steps and steps.size else 1e-2 * scene.t_end
    return float(f"{_round(SHARE * usual) / 2.0:.3g}")
