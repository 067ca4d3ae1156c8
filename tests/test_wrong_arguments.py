"""Every public function, given what makes no sense, says in a sentence what it needs."""

import importlib
import inspect
import linecache
import re
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

import cgraph as cg
import cgraph.extend as extend
import dynamics as dyn
import viz
from cgraph.extend import OPS
from cgraph.operations.operation import function
from dynamics.multiprecision.reference import Reference
from dynamics.simulation.applied_force import HeldForces
from dynamics.simulation.trajectory import Sides
from viz.graph_drawing.render import RenderError

RESULTS = Path(__file__).parents[1] / "docs" / "reference" / "results.md"
ARM, TWO = dyn.planar_arm([1.0], [1.0]), dyn.planar_arm([1.0, 0.5], [1.0, 1.0])
X, Y = cg.variables("x y")
JUNK = {
    "None": None,
    "3": 3,
    "-1": -1,
    "2.5": 2.5,
    "text": "a",
    "no text": "",
    "[]": [],
    "{}": {},
    "object": object(),
    "mechanism": ARM,
    "class": dyn.System,
    "NaN": float("nan"),
    "objects": np.array([None, "a"], dtype=object),
    "huge": 10**400,
    "complex": 2j,
    "node": X,
    "bytes": b"a",
    "lambda": lambda *given: None,
    "[[3]]": [[3]],
    "['a']": ["a"],
    "{3: 3}": {3: 3},
    "{'a': 'a'}": {"a": "a"},
    "array": np.zeros((2, 2)),
    "infinity": float("inf"),
}
FEW = ("None", "-1", "text", "object", "NaN", "objects", "[[3]]", "{3: 3}")  # the others run with the slow tests
FILLED = ("shared",)  # fields that only the library fills in
NEVER = ("object", "class", "objects")  # what makes sense as no argument at all
# Errors of ours among them: GraphError, MechanismError, ...
SENTENCES = (TypeError, ValueError, OSError, MemoryError, RenderError)


class Call(NamedTuple):
    """A call that is right, of which one argument after the other is replaced by junk."""

    function: Callable[..., Any]
    args: tuple[Any, ...]
    named: dict[str, Any]


def call(function: Callable[..., Any], /, *args: Any, **named: Any) -> Call:
    """With the defaults of the parameters that are not given."""
    signature = inspect.signature(function)
    given = {*signature.bind(*args, **named).arguments, *FILLED}
    rest = {key: each.default for key, each in signature.parameters.items() if key not in given}
    return Call(function, args, {key: rest[key] for key in rest if rest[key] is not inspect.Parameter.empty} | named)


def tagged(*names):
    with cg.tag(*names):
        pass


def body(name="b", parent="world"):
    return dyn.Body(name, dyn.Joint("revolute"), parent, 1.0, (0.0, 0.0, 0.0), (0.1, 0.1, 0.1))


OPEN = dyn.Mechanism([dyn.Body("b", dyn.Joint("revolute"), mass="m", inertia=(1.0, 1.0, 1.0))], parameters={"m": 1.0})


def closed(body_name, to, at, to_at, axis, length, coefficients, name, tolerance):
    """One-body mechanisms with a loop of every kind."""
    for kind in ("distance", "hinge", "rolling"):
        loop = dyn.Loop(kind, body_name, to, at, to_at, axis, axis, length=length, name=name, tolerance=tolerance)
        dyn.Mechanism([body(), body("c", "b")], loops=[loop])
    coupling = dyn.Loop("coupling", body_name, "c", coefficients=coefficients, name=name)
    return dyn.Mechanism([body(), body("c", "b")], loops=[coupling])


def touching(body_name, to, at, to_at, normal, radius, to_radius, stiffness, dissipation, friction, velocity):
    """A mechanism with contacts of both kinds."""
    material = {"stiffness": stiffness, "dissipation": dissipation, "friction": friction, "velocity": velocity}
    plane = dyn.Contact(body_name, to, at=at, to_at=to_at, normal=normal, radius=radius, **material)
    sphere = dyn.Contact(body_name, to, at=at, to_at=to_at, radius=radius, to_radius=to_radius, **material)
    return dyn.Mechanism([body(), body("c", "b")], forces=[plane, sphere])


def lagrangian(q, qd, t):
    return 0.5 * qd[0] ** 2


def first(q, qd, t):
    return q[0]


GRAPH, SQUARES = cg.Graph([X, Y], {"r": X * Y}), cg.Graph([X, Y], {"r": X * X + Y * Y})
HALVE = cg.Graph([X], {"next": 0.5 * X})
DECAY = dyn.OdeSystem(lambda x, t: [-x[0]], ["x"])
MOTION = dyn.prepare(ARM, "rk4", dt=0.01, backend="python", estimate_error=False)
ROBOT = """<robot name="r"><link name="world"/><link name="b"><inertial><mass value="1"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j" type="continuous"><parent link="world"/><child link="b"/></joint></robot>"""
RUN = dyn.simulate(ARM, [0.1], [0.0], 0.02, "rk4", dt=0.01, backend="python", dense_output=True)
START = ([0.1], [0.0], 0.02, "euler")
SIDES = Sides(("qd.x",), np.zeros(1), np.ones((1, 1)), np.zeros((1, 1), dtype=bool))
TABLE, SYSTEM, SUBTREE = dyn.torque_by_link(ARM), dyn.System(lagrangian, ["a"]), TWO.subtree(TWO.bodies[1].name)
EXACT = Reference((0.0, 1.0), (("0.0", "1.0"), ("0.0", "1.0")), 1e-30, "by hand")
ROWS = dyn.Rows(ARM)
ROWS_TAKE = {"inverse": 3, "forward": 3, "inverse_derivatives": 3, "forward_derivatives": 3, "mass_matrix": 1}
ROWS_TAKE |= {"energy": 2, "frames": 1, "inertial_gradient": 4}


def rows_changed(mechanism, method):
    """Makes a change of rows that are new."""
    return lambda *args: getattr(dyn.Rows(mechanism), method)(*args)


def with_joint(*args, **named):
    return dyn.Mechanism([dyn.Body("b", dyn.Joint(*args, **named), "world", 1.0, (0.0, 0.0, 0.0), (0.1, 0.1, 0.1))])


def with_body(*fields):
    return dyn.Mechanism([dyn.Body(*fields)])


def on_joint(kind):
    """Makes a mechanism with a force of that kind on its joint."""
    return lambda *numbers: dyn.Mechanism([body("b")], forces=[kind(*numbers)])


LINK = {"joint": dyn.Joint("revolute"), "mass": 1.0, "inertia": (0.1, 0.1, 0.1)}
FIRST, LAST = TWO.bodies[0].name, TWO.bodies[1].name
CHANGES = {  # of a mechanism, and what they take
    "attach": (TWO.detach(LAST), SUBTREE, None),
    "detach": (TWO, LAST),
    "lock": (TWO, FIRST, 0.0),
    "unlock": (TWO.lock(FIRST), FIRST),
    "with_body": (TWO, TWO.bodies[0]),
}
STEPS = dict.fromkeys(("max_step", "rtol", "atol", "first_step")) | {"form": "velocity", "backend": "python"}
STEPS |= {"estimate_error": False}
SPAN = {"t0": 0.0, "t_span": None}
RUNS = STEPS | {"dt": 0.01, "max_steps": 100, "fma": False, "progress": False}
SLOPES = STEPS | SPAN | {"wrt": ["q"], "dt": 0.02, "tau": [0.0]}
FILES = {"ignore": True, "limits": (1e3, 0.1), "friction": 0.1, "contacts": "compliant"}
TAKE_A_GRAPH = "gradient hessian html hvp jacobian jvp lint simplify sparsity structure_hash to_js to_networkx vjp"
MODEL_ALONE = """Rows as_system base_parameters bias center_of_mass center_of_mass_jacobian conserved coriolis
    damping_force display_names energy formulation_sizes forward_dynamics gravity_force inertial_parameters
    inverse_dynamics_derivatives inverse_mass_matrix kinetic_energy mass_matrix momentum momentum_rate
    potential_energy regressor spatial_momentum state_equation state_space to_mjcf torque_by_cause
    torque_by_joint_motion torque_by_link"""

CALLS = {
    **{f"cg.{op.name}": call(function(op), *[X] * op.arity) for op in OPS.values()},
    **{f"cg.{name}": call(getattr(cg, name), GRAPH) for name in TAKE_A_GRAPH.split()},
    "cg.compare": call(cg.compare, GRAPH, SQUARES),
    "cg.compile": call(cg.compile, GRAPH, "python"),
    "cg.constant": call(cg.constant, 1.0),
    "cg.hessian_solve": call(cg.hessian_solve, SQUARES, ["x", "y"], [1.0, 2.0]),
    "cg.from_networkx": call(cg.from_networkx, cg.to_networkx(GRAPH)),
    "cg.interp": call(cg.interp, X, [0.0, 1.0], [2.0, 3.0]),
    "cg.latex": call(cg.latex, X * Y, lines=5),
    "cg.specialize": call(cg.specialize, GRAPH, {"x": 1.0}),
    "cg.tag": call(tagged, "a"),
    "cg.to_c": call(cg.to_c, GRAPH, "f"),
    "cg.to_scipy": call(cg.to_scipy, cg.compile(cg.Graph([X], {"r": X * X}))),
    "cg.variable": call(cg.variable, "x"),
    "cg.variables": call(cg.variables, "x y"),
    "cg.why": call(cg.why, GRAPH, "r", "x", at={"x": 1.0, "y": 2.0}),
    "cg.why_nan": call(cg.why_nan, GRAPH, {"x": 0.3, "y": 0.4}, "r", "x"),
    "cg.why_not": call(cg.why_not, cg.Graph([X, Y], {"r": X}), "r", "y"),
    "cg.with_name": call(cg.with_name, X * Y, "n"),
    "cg.Graph": call(cg.Graph, [X, Y], {"r": X * Y}),
    "cg.Graph()": call(GRAPH, 1.0, y=2.0),
    **{f"cg.Graph.{name}": call(getattr(GRAPH, name), {"x": 1.0, "y": 2.0}) for name in ("evaluate", "values")},
    "cg.Graph.select_inputs": call(GRAPH.select_inputs, None),
    "cg.Compiled()": call(cg.compile(GRAPH, "python"), [1.0, 2.0]),
    "cg.Compiled.bind": call(cg.compile(GRAPH, "python").bind, np.ones(2), np.ones(1)),
    "cg.Compiled.batch": call(cg.compile(GRAPH, "python").batch, [[1.0], [2.0]]),
    **{f"cg.Compiled.{name}": call(getattr(cg.compile(GRAPH, "python"), name), [1.0, 2.0], [[1.0] * count])
       for name, count in {"jvp": 2, "vjp": 1}.items()},
    "cg.Compiled.jacobian": call(cg.compile(GRAPH, "python").jacobian, [1.0, 2.0]),
    "cg.Compiled.hessian": call(cg.compile(GRAPH, "python").hessian, [1.0, 2.0], [1.0]),
    "cg.Compiled.bind_jacobian": call(cg.compile(GRAPH, "python").bind_jacobian, np.ones(2), np.ones((1, 2))),
    "cg.Comparison.classes": call(cg.compare(GRAPH, SQUARES).classes, "left"),
    "cg.CSource.write": call(cg.to_c(GRAPH).write, "."),
    **{f"dyn.{name}": call(getattr(dyn, name), ARM) for name in MODEL_ALONE.split()},
    "dyn.freedom": call(dyn.freedom, ARM, [0.0], tolerance=1e-4),
    "dyn.consistent_state": call(dyn.consistent_state, ARM, [0.0], [0.0]),
    **{f"dyn.frame_{name}": call(getattr(dyn, f"frame_{name}"), ARM, FIRST)
       for name in ("acceleration", "bias_acceleration", "jacobian", "jacobian_rate", "placement", "velocity")},
    **{f"dyn.Mechanism.{name}": call(getattr(ARM, name), FIRST) for name in ("chain", "motion", "position")},
    "dyn.arrays_at": call(dyn.arrays_at, ARM, dyn.mass_matrix(ARM), [0.0]),
    "dyn.hamiltonian": call(dyn.hamiltonian, ARM, iterations=4),
    "dyn.hamilton_equations": call(dyn.hamilton_equations, ARM, iterations=4),
    "dyn.inverse_dynamics": call(dyn.inverse_dynamics, ARM, "chain_rule"),
    "dyn.formulation_verdict": call(dyn.formulation_verdict, ARM, at={"q0": 0.1}),
    **{f"dyn.{name}": call(getattr(dyn, name), SYSTEM, [0.0], [0.0])
       for name in ("linearize", "reduced_linearization")},
    "dyn.linearize_many": call(dyn.linearize_many, SYSTEM, [[0.0]], [[0.0]]),
    "dyn.raise_if_singular": call(dyn.raise_if_singular, ARM, 0.0),
    "dyn.spurious_nodes": call(dyn.spurious_nodes, GRAPH),
    "dyn.prune": call(dyn.prune, ARM, effects=(), regroup=True),
    "dyn.certify": call(dyn.certify, SYSTEM, 1),
    "dyn.planar_arm": call(dyn.planar_arm, [1.0], [1.0]),
    "dyn.serial_arm": call(dyn.serial_arm, [LINK]),
    "dyn.tree": call(dyn.tree, [-1]),
    "dyn.reference": call(dyn.reference, DECAY, [1.0], None, [0.0, 0.1], digits=15),
    "dyn.load_mjcf": call(dyn.load_mjcf, dyn.to_mjcf(ARM), actuators=True, **FILES),
    "dyn.load_urdf": call(dyn.load_urdf, ROBOT, **FILES),
    "dyn.simulate": call(dyn.simulate, ARM, [0.1], [0.0], 0.02, "rk4", dense_output=False, **SPAN, **RUNS),
    "dyn.simulate_many": call(dyn.simulate_many, ARM, [[0.1]], [[0.0]], 0.02, "rk4", chunk=None, **SPAN, **RUNS),
    "dyn.prepare": call(dyn.prepare, ARM, "rk4", dense_output=False, **RUNS),
    "dyn.gradient": call(dyn.gradient, ARM, first, *START, running=lambda q, qd, tau, t: q[0], **SLOPES),
    "dyn.gradient_many": call(
        dyn.gradient_many, ARM, first, [[0.1]], [[0.0]], 0.02, "euler", running=lambda q, qd, tau, t: q[0],
        parameters={}, **SLOPES | {"tau": [[0.0]]}
    ),
    "dyn.sensitivities": call(dyn.sensitivities, ARM, *START, **SLOPES),
    "dyn.Run()": call(MOTION, [0.1], [0.0], 0.02, t_eval=[0.01]),
    "dyn.Run.ends": call(MOTION.ends, [[0.1], [0.2]], [0.0], 0.02),
    **{f"dyn.Run.{name}": call(getattr(MOTION, name), [0.1], [0.0], 0.02) for name in ("end", "start")},
    "dyn.MotionSteps.propagate_until": call(MOTION.start([0.1], [0.0], 1.0).propagate_until, 0.02),
    "dyn.attach_with_impact": call(dyn.attach_with_impact, ARM, [0.0], [0.0], body(parent=ARM.bodies[0].name)),
    "dyn.release": call(dyn.release, TWO, [0.0, 0.0], [0.0, 0.0], TWO.bodies[-1].name),
    "dyn.Joint": call(
        with_joint, "revolute", axis=(0.0, 0.0, 1.0), position=(0.0, 0.0, 0.0), orientation=np.eye(3).tolist(),
        damping=0.0, stiffness=0.0, spring_reference=0.0, armature=0.0, pitch=0.0, second_axis=None, name="q",
        limits=None
    ),
    "dyn.Limits": call(dyn.Limits, (-1.0, 1.0), velocity=(-1.0, 1.0), effort=(-1.0, 1.0)),
    "dyn.Body": call(with_body, "b", dyn.Joint("revolute"), "world", 1.0, (0.0, 0.0, 0.0), (0.1, 0.1, 0.1), 0.5),
    "dyn.start": call(dyn.start, dyn.Mechanism(ARM.bodies, starts={"home": {}}), "home"),
    "dyn.JointSpring": call(on_joint(dyn.JointSpring), "b", 1e3, 0.1, -1.0, 1.0),
    "dyn.JointLimit": call(on_joint(dyn.JointLimit), "b", -1.0, 1.0, 1e3, 0.1),
    "dyn.JointFriction": call(on_joint(dyn.JointFriction), "b", 1.0, 0.1),
    "dyn.Actuator": call(
        on_joint(dyn.Actuator), "b", "u", 1.0, (1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (-1.0, 1.0), (-1.0, 1.0), (-1.0, 1.0)
    ),
    "dyn.Contact": call(
        touching, "b", "c", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.1, 0.2, 1e3, 0.1, 0.5, 0.1
    ),
    "dyn.SampledController": call(dyn.SampledController, lambda q, qd, t: q, 0.1),
    "dyn.HeldForces.at": call(HeldForces(np.zeros(1), np.zeros((1, 1))).at, [0.1]),
    "dyn.with_controller": call(dyn.with_controller, ARM, lambda q, qd, t, p: [p["k"]], {"k": 1.0}),
    "dyn.Loop": call(lambda kind: dyn.Loop(kind, "b"), "point"),
    "dyn.Mechanism with a loop": call(
        closed, "b", "world", (0, 0, 0), (0, 0, 0), (0, 0, 1), 1.0, [0.0, 1.0], "loop", 2e-4
    ),
    "dyn.Event": call(dyn.Event, "e", first),
    "dyn.Mechanism": call(dyn.Mechanism, [body()], (0.0, 0.0, -9.81), (), {}, {}, starts={}),
    "dyn.OdeSystem": call(dyn.OdeSystem, lambda x, t: [-x[0]], ["x"], {}),
    "dyn.System": call(dyn.System, lagrangian, ["a"], {}),
    "dyn.Scene": call(dyn.Scene, "s", "about", ARM, (0.0,), (0.0,), 1.0),
    **{f"dyn.Mechanism.{name}": call(getattr(of, name), *args) for name, (of, *args) in CHANGES.items()},
    **{f"dyn.Rows.{name}": call(rows_changed(of, name), *args) for name, (of, *args) in CHANGES.items()},
    **{f"dyn.Rows.{name}": call(getattr(ROWS, name), *[[0.0]] * count) for name, count in ROWS_TAKE.items()},
    "dyn.Mechanism.bind": call(OPEN.bind, {"m": 2.0}),
    "dyn.Mechanism.joint_positions": call(ARM.joint_positions, [0.0]),
    "dyn.Mechanism.map_state_from": call(ARM.map_state_from, ARM, [0.0], [0.0]),
    "dyn.Mechanism.contact": call(ARM.contact, dyn.Contact(FIRST, stiffness=1.0)),
    "dyn.Mechanism.subtree": call(TWO.subtree, LAST),
    **{f"dyn.Reference.{name}": call(getattr(EXACT, name), [[0.0, 1.0], [0.0, 1.0]])
       for name in ("deviation", "relative_error")},
    "dyn.Subtree.with_parent": call(SUBTREE.with_parent, "world"),
    "dyn.System.mass_matrix": call(SYSTEM.mass_matrix, SYSTEM.lagrangian),
    "dyn.System.graph": call(SYSTEM.graph, {"o": SYSTEM.q[0]}, SYSTEM.q),
    "dyn.Verdict.excess_at": call(dyn.formulation_verdict(SYSTEM).excess_at, {"q0": 0.0, "qd0": 0.0}),
    "dyn.TorqueTable.at": call(TABLE.at, [0.0], [0.0], [0.0]),
    **{f"dyn.TorqueTable.{name}": call(getattr(TABLE, name), 4) for name in ("to_latex", "to_markdown", "to_text")},
    "dyn.Trajectory.solution": call(RUN.solution, [0.005]),
    "dyn.Trajectory[]": call(RUN.__getitem__, "q.joint 1"),
    "dyn.Sides.at": call(SIDES.at, np.array([0.1])),
    "dyn.MotionGradient[]": call(dyn.gradient(ARM, first, *START).__getitem__, "q"),
    "dyn.Sensitivities[]": call(dyn.sensitivities(ARM, *START).__getitem__, "q"),
    "dyn.scenes.load": call(dyn.scenes.load, "chain", n=2),
    "dyn.scenes.chain": call(dyn.scenes.chain, 2),
    "dyn.scenes.triple_pendulum": call(dyn.scenes.triple_pendulum),
    "dyn.cases.load": call(dyn.cases.load, "exponential decay"),
    "viz.lesson": call(viz.lesson, ARM, subject="torque", title="t", author="a"),
    "viz.animate": call(viz.animate, ARM, dyn.simulate(ARM, [0.1], [0.0], 0.04), wanted=lambda t: t[:, np.newaxis]),
    "viz.draw": call(viz.draw, ARM),
    "viz.live": call(viz.live, ARM, start=[0.1, 0.0]),
    "viz.driven": call(viz.driven, ARM, "chain_rule", 0.1),
    "viz.inspect": call(viz.inspect, ARM, start=[0.1, 0.0], t_end=0.1),
    "viz.page": call(viz.page, GRAPH, title="t", marked=(), columns={"link 1": "base"}, notices=["n"]),
    "viz.typed_page": call(viz.typed_page, "L = x'^2"),
    "viz.typed_text": call(viz.typed_text, ARM, [0.1], [0.0]),
    "viz.render_svg": call(viz.render_svg, "digraph {}", timeout=5.0),
    "viz.render_png": call(viz.render_png, "<svg xmlns='http://www.w3.org/2000/svg' width='1' height='1'/>"),
    "viz.to_dot": call(viz.to_dot, GRAPH, marked_label=""),
}  # fmt: skip

ONE, SQUARE = cg.constant(1.0), X * X
HALF = extend.Call(HALVE, ("x",), ("x",))
PROGRAM = extend.Program({"x": 1}, [HALF], ["x"])
RUNNER = extend.runner(PROGRAM, "python")
FED = extend.runner(extend.Program({"x": 1}, [HALF], ["x"], feed=["x"]), "python")
PLAIN = extend.Notation(
    lambda names: {name: name for name in names},
    lambda value: (f"{value:g}", 4),
    lambda op, args: (op.name, 3),
    "v{}".format,
)
NAMES = extend.Names(GRAPH)
FORMULAS = extend.Formulas(GRAPH.nodes, GRAPH.outputs, PLAIN)


def a_program_of(statement):
    return lambda *fields: extend.Program({"x": 1, "y": 1, "z": 1}, [statement(*fields)], ["x"])


HALVING = ((0, 0), (1, -1)), (((0, 1),),), (((1, 1),),), ((),)  # blocks, and what a row reads, writes, adds to


def built_by(build):
    with extend.building(build):
        return X + Y


def registered(op):
    return op is OPS["sin"] or extend.register(op)


def registered_statement(row):
    return row is extend.STATEMENTS[extend.Call] or extend.register_statement(row)


CALLS |= {
    **{
        f"extend.{name}": call(getattr(extend, name), GRAPH)
        for name in ("Names", "compressed_jacobian", "jets", "with_reciprocals")
    },
    "extend.Call": call(a_program_of(extend.Call), HALVE, ("x",), ("y",)),
    "extend.FixedPoint": call(a_program_of(extend.FixedPoint), "x", (HALF,)),
    "extend.For": call(a_program_of(extend.For), (HALVE,), "x", "y", ("x",), ("x",), ("z",), *HALVING),
    "extend.many": call(extend.many, PROGRAM),
    "extend.program_jvp": call(extend.program_jvp, PROGRAM, [], constant=[]),
    "extend.program_vjp": call(extend.program_vjp, PROGRAM, ["x"], [], constant=[], backend="python"),
    "extend.register_statement": call(registered_statement, extend.STATEMENTS[extend.Call]),
    "extend.Factor": call(a_program_of(extend.Factor), "x", "y"),
    "extend.added": call(a_program_of(extend.added), "x", "y", "z"),
    "extend.copied": call(a_program_of(extend.copied), "x", "y"),
    "extend.Formulas": call(extend.Formulas, GRAPH.nodes, GRAPH.outputs, PLAIN),
    "extend.If": call(a_program_of(extend.If), "x", (HALF,), (HALF,)),
    "extend.Map": call(a_program_of(extend.Map), GRAPH, ("x",), ("y",), ("z",)),
    **{f"extend.Names.{name}": call(getattr(NAMES, name), X) for name in "called formula line short text".split()},
    **{f"extend.Names.{name}": call(getattr(NAMES, name), "x") for name in ("group", "meant", "shown")},
    **{f"extend.Names.{name}": call(getattr(NAMES, name), "x", "a node") for name in ("all", "one", "output")},
    "extend.Program": call(
        extend.Program, {"x": 1, "p": 1}, [HALF], ["x"], record_if="x", stop="x", feed=["x"], shared={"p": 1.0}
    ),
    "extend.Program.check_shared": call(PROGRAM.check_shared, {"x": 1.0}),
    "extend.Program.listing": call(PROGRAM.listing, {"halve": HALVE}),
    "extend.Formulas.lines": call(FORMULAS.lines, list(GRAPH.outputs.values())),
    "extend.effects": call(extend.effects, [HALF]),
    "extend.Runner.bind": call(RUNNER.bind, np.zeros(1), np.zeros((2, 1))),
    "extend.Runner.read": call(RUNNER.read, np.ones(1), "x"),
    "extend.Runner.write": call(RUNNER.write, np.ones(1), "x", 1.0),
    "extend.Runner.text": call(RUNNER.text, "x"),
    "extend.Runner.memory": call(RUNNER.memory, {"x": 1.0}),
    "extend.Runner.run": call(FED.run, np.zeros(1), 2, 1, np.zeros((2, 1))),
    "extend.Solve": call(a_program_of(extend.Solve), "x", "y", "z"),
    "extend.Sum": call(a_program_of(extend.Sum), HALVE, ("x",), ("y",)),
    "extend.While": call(a_program_of(extend.While), "x", (HALF,)),
    "extend.as_node": call(extend.as_node, 1.0),
    "extend.building": call(built_by, extend.Builder()),
    "extend.certain_digits": call(extend.certain_digits, GRAPH, {"x": 1.0, "y": 2.0}),
    "extend.straight": call(extend.straight, extend.jets(GRAPH), 2),
    "extend.enclosure": call(extend.enclosure, GRAPH, []),
    "extend.cotangents": call(extend.cotangents, {X * Y: ONE}, [X, Y], through={}),
    "extend.folded": call(extend.folded, [X * Y], extend.Builder(), {X: Y}),
    "extend.hessian_nodes": call(extend.hessian_nodes, X * Y, [X, Y]),
    "extend.register": call(registered, OPS["sin"]),
    "extend.runner": call(extend.runner, PROGRAM, "python"),
    "extend.solve_nodes": call(extend.solve_nodes, SQUARE, [X], [Y], at={SQUARE: Y}),
    "extend.tangents": call(extend.tangents, {X: Y}, [SQUARE]),
    "extend.topological": call(extend.topological, [X * Y]),
}
# What errors may say in place of a parameter's name, or of the singular of it.
WORDS = {
    "x": ("shape", "values"),
    "args": ("a Node or a real number", "constant"),
    "at": ("input",),
    "atoms": ("node called",),
    "called": ("names",),
    "damping": ("variable",),
    "depends": ("nothing in the graph is called", "a node"),
    "gravity": ("variable",),
    "input": ("depends on",),
    "lengths": ("body", "variable"),
    "masses": ("mass", "body", "variable"),
    "mechanism": ("q must",),
    "model": ("a System, a mechanism or a scene", "Mechanism", "qd must"),
    "name": ("register", "scene"),
    "output": ("matrix",),
    "outputs": ("constant",),
    "node": ("constant",),
    "passes": ("feed",),
    "path": ("file must",),
    "rhs": ("constant",),
    "source": ("a model", "file", "folder"),
    "start": ("q needs",),
    "state": ("input",),
    "tau": ("linearize takes",),
    "to": ("body",),
    "twin": ("a model", "file"),
    "values": ("input", "register", "real numbers"),
    "t0": ("t_eval",),
    "value": ("register",),
    "lagrangian": ("output",),
    "who": ("a node", "nothing in the graph is called"),
    "wrt": ("input", "variable", "shape", "one entry"),
    "y": ("a Node or a real number", "constant"),
}

# Records: plain data that the library fills in, or that is checked when a mechanism is made of it.
RECORDS = """
    cg.Compiled cg.Counts cg.Edge cg.Node dyn.Ensemble dyn.Force dyn.JointForce dyn.Options dyn.Run
    dyn.QuasiVelocities dyn.Subtree dyn.Trajectory dyn.Verdict extend.MathML extend.Statement extend.StatementRow
    extend.Notation extend.Op
"""
# Nothing to give; types; decorators; what a mechanism calls; what empties the user's caches; the fast way into compiled
# code, which looks at nothing, and into the names of nodes; what needs a package that need not be there, see
# `tests/cgraph/bridges`.
LEFT_OUT = """dyn.Mechanism.generalized_forces dyn.System.braking extend.Names.inputs_of
    dyn.System.changed dyn.System.require_known dyn.System.require_values
    extend.require_length dyn.JointForce.check dyn.JointForce.along dyn.JointLimit.along
    dyn.JointLimit.check dyn.JointSpring.along dyn.JointSpring.check dyn.JointFriction.along
    dyn.JointFriction.check dyn.Actuator.along dyn.Actuator.check cg.as_jax cg.to_casadi cg.to_jax
    cg.to_torch cg.recording_lines cg.clear_cache cg.clear_caches cg.Compiled.values extend.Builder
    extend.Builder() extend.Runner extend.Runner.lane_code cg.Graph.latex cg.Graph.to_networkx
    extend.Runner.bind_pass extend.Runner.columns extend.Runner.columns_from"""


SIGNS = {"__call__": "()", "__getitem__": "[]"}


def public():
    """Names of public functions, of classes, and of methods of these and of results."""
    packages = {"cg": cg, "dyn": dyn, "viz": viz, "extend": extend}
    things = {f"{short}.{name}": getattr(module, name) for short, module in packages.items() for name in module.__all__}
    failures = [name for name, each in things.items() if isinstance(each, type) and issubclass(each, BaseException)]
    yield from (name for name, thing in things.items() if callable(thing) and name not in failures)
    for module, names in re.findall(r"{names} (\S+)\n(.*?)```", RESULTS.read_text(), re.DOTALL):
        package = {"cgraph": "cg", "dynamics": "dyn"}[module.partition(".")[0]]
        things |= {f"{package}.{name}": getattr(importlib.import_module(module), name) for name in names.split()}
    for name, thing in things.items():
        for method, each in vars(thing).items() if isinstance(thing, type) else ():
            end = SIGNS.get(method, "" if method.startswith("_") else f".{method}")
            if end and inspect.isfunction(each) and len(inspect.signature(each).parameters) > 1:
                yield name + end


def test_the_table_has_every_public_function():
    aliases = {"cg.abs_": "cg.abs", "cg.round_": "cg.round"}
    known = {aliases.get(name, name) for name in CALLS} | set(RECORDS.split()) | set(LEFT_OUT.split())
    assert [name for name in public() if name not in known] == []


def stand_ins(value, junk):
    """The junk; and the value with junk in place of its first entry."""
    yield junk
    if isinstance(value, dict):
        yield from ({**value, key: junk} for key in list(value)[:1])
    elif type(value) in (list, tuple) and value:
        yield type(value)([junk, *value[1:]])
        yield from (type(value)([entry, *value[1:]]) for entry in list(stand_ins(value[0], junk))[1:])


def fault_of(name, parameter, junk, error):
    """What is wrong with the answer to junk, if anything: None is a call that was taken."""
    if error is None:
        return "is taken" if junk in NEVER and not name.startswith("extend.") else None
    if not isinstance(error, SENTENCES):
        return f"raises {type(error).__name__}: {error}"
    *_, (frame, number) = traceback.walk_tb(error.__traceback__)
    file = frame.f_code.co_filename
    if not linecache.getline(file, number).strip().startswith("raise "):  # Python or NumPy stumbled over it
        return f"is not looked at: {error} ({file}:{number})"
    if len(str(error).split()) <= 3:
        return f"gets no sentence: {error}"
    told, function = str(error).casefold(), CALLS[name].function
    if (
        len(parameters_of(name)) == 1
        or getattr(function, "__module__", None) == __name__
        or junk in ("class", "lambda")
    ):
        return None
    words = [parameter, parameter.replace("_", " "), parameter.removesuffix("s"), getattr(function, "__name__", name)]
    named = any([word.casefold() in told for word in (*words, *WORDS.get(parameter, ()))])
    return None if named else f"is not named: {error}"


def parameters_of(name):
    """{place: the parameter there} of a call."""
    function, args, named = CALLS[name]
    known = list(inspect.signature(function).parameters)
    return dict(enumerate([*known, *known[-1:] * len(args)][: len(args)])) | {key: key for key in named}


def faults(name, labels):
    """What is wrong with the answers of a call to all these, in every place."""
    function, args, named = CALLS[name]
    function(*args, **named)
    for place, parameter in parameters_of(name).items():
        for label in labels:
            for stand_in in stand_ins(named[place] if place in named else args[place], JUNK[label]):
                positional = [stand_in if k == place else value for k, value in enumerate(args)]
                error = None
                try:
                    function(*positional, **(named | {place: stand_in} if place in named else named))
                except Exception as raised:  # noqa: BLE001 (all kinds are judged)
                    error = raised
                if fault := fault_of(name, parameter, label, error):
                    yield f"{parameter} = {label} {fault}"


ROOMS = sorted({name.rpartition(".")[0] for name in CALLS})


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("labels", [FEW, pytest.param(tuple(JUNK.keys() - set(FEW)), marks=pytest.mark.slow)])
@pytest.mark.parametrize("room", ROOMS)
def test_junk_in_any_place_is_told_in_a_sentence(room, labels, here):
    """Whatever stands in place of a right argument or entry: an answer, or an error that the library itself raises."""
    names = [name for name in CALLS if name.rpartition(".")[0] == room]
    assert {name: found for name in names if (found := list(faults(name, labels)))} == {}


def said(function, *args, **named):
    """What a call says against its arguments; None where it takes them."""
    try:
        function(*args, **named)
    except SENTENCES as error:
        return str(error)
    return None


GRAPH_ALONE = f"{TAKE_A_GRAPH} compile to_c to_casadi to_jax".replace("html ", "")
GRAPH_FIRST = [
    *[(function, ()) for function in (dyn.spurious_nodes, viz.page, viz.to_dot)],
    *[(getattr(cg, name), ()) for name in GRAPH_ALONE.split()],
    *[(function, ({},)) for function in (cg.compare, cg.specialize, cg.why_nan)],
    *[(function, ("y", "x")) for function in (cg.hessian_solve, cg.why, cg.why_not)],
]


def test_what_needs_a_graph_says_so_and_where_a_model_has_one():
    for needy, more in GRAPH_FIRST:
        for junk in JUNK.values():
            if needy is viz.page and isinstance(junk, list):
                continue  # no version
            assert f"{needy.__name__} needs a cg.Graph, got {type(junk).__name__}" in said(needy, junk, *more)
        assert said(needy, ARM, *more).endswith("forward_dynamics(model) of the package dynamics is one")
        assert said(needy, X, *more).endswith("write cg.Graph(inputs, {name: node})")


CASES = {
    "a chain too long": (lambda: dyn.scenes.load("chain", n=10**12), "more than can be derived"),
    "info of no coordinate": (lambda: dyn.raise_if_singular(ARM, 7.0), "from 1 to 1 for a coordinate, got 7"),
    "rows without room": (lambda: RUNNER.run(np.ones((1, 1)), 10**12), "Unable to allocate"),
    "kind of a joint": (lambda: dyn.Joint("cogwheel"), "must be one of ball, fixed, free, free (body axes), "),
    "start too long": (lambda: dyn.scenes.Scene("s", "", ARM, (0.0, 0.0), (0.0,), 1.0), "q needs 1 finite numbers"),
}


def test_a_wrong_value_is_told():
    for case, (call, words) in CASES.items():
        assert words in said(call), case
