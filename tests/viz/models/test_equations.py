"""The equations that a person reads mean the graphs: every line is computed again from its text."""

import math
import re
from functools import cache, partial
from xml.etree import ElementTree

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
from cgraph._shared import LATEX, statements
from dynamics.equations.constraints.constraints import constraint_rows
from dynamics.equations.equations_of_motion import momentum
from dynamics.equations.formulations.formulations import inverse_dynamics
from dynamics.equations.momentum.hamiltonian import hamilton_equations
from dynamics.equations.state_equation import state_equation
from tests.dynamics.equations.test_constraints import sleigh
from tests.dynamics.linkages import four_bar
from tests.each_row import each_row
from viz import cli
from viz.models.equations import LETTERS, Equations, model_equations
from viz.models.equations_text import ALL_DIGITS, equations_html, equations_latex, equations_text, plain
from viz.pages.mathml import NOTATION, typeset

FUNCTIONS = {name: getattr(math, name) for name in ("sin", "cos", "exp", "sqrt", "tanh")} | {"abs": abs}
MANY = 10**6
CLOSE = 1e-9  # of values, and of the largest of them: a reading form adds in another order


def pulley():
    def lagrangian(q, qd, t, p):
        return 0.5 * (p["m"] + p["M"]) * qd[0] ** 2 - (p["m"] - p["M"]) * -p["g"] * q[0] / -(2 - q[0] ** 3)

    return dyn.System(lagrangian, ["x"], {"m": 1.0, "M": 2.0, "g": 9.81}, damping=0.1)


def cart_pole():
    def lagrangian(q, qd, t, p):
        pole = (qd[0] + p["l"] * cg.cos(q[1]) * qd[1]) ** 2 + (p["l"] * cg.sin(q[1]) * qd[1]) ** 2
        return 0.5 * p["M"] * qd[0] ** 2 + 0.5 * p["m"] * pole - p["m"] * p["g"] * p["l"] * cg.cos(q[1])

    return dyn.System(
        lagrangian, ["x", "theta"], {"M": 2.0, "m": 0.5, "l": 0.7, "g": 9.81}, damping=[0.1, 0.0],
        forces=lambda q, qd, t, p: [cg.sin(t) * p["l"], 0.0],
    )  # fmt: skip


def hoop():
    def lagrangian(q, qd, t, p):
        return 0.5 * p["m"] * p["R"] ** 2 * (qd[0] ** 2 + p["Omega"] ** 2 * cg.sin(q[0]) ** 2) + p["m"] * cg.cos(q[0])

    return dyn.System(lagrangian, ["theta"], {"m": 1.0, "R": 2.0, "Omega": 3.0})


def relativistic():
    """Not quadratic in the velocities, depends on time, and has operations of every kind."""

    def lagrangian(q, qd, t):
        walls = cg.where(q[1] > 0.4, q[1] ** 1.5, cg.exp(-q[0])) + abs(q[0] - 3.0) + cg.minimum(q[0], q[1] / 3.0)
        return -cg.sqrt(9.0 - qd[0] ** 2 - qd[1] ** 2) + q[0] * qd[1] * t - walls * (1.0 - 1e-9 * q[0])

    return dyn.System(lagrangian, ["x", "y"])


def rod():
    """A damped mass on a rod that grows."""
    return dyn.System(
        lambda q, qd, t, p: 0.5 * p["m"] * (qd[0] ** 2 + qd[1] ** 2) - p["m"] * 9.81 * q[1], ["x", "y"], {"m": 2.0},
        damping=0.1, constraints=lambda q, t: {"rod": 0.5 * (q[0] ** 2 + q[1] ** 2 - (1.0 + t) ** 2)},
    )  # fmt: skip


def spatial_arm(n):
    links = [
        {"joint": dyn.Joint("revolute", axis=np.eye(3)[2 - i % 3], position=(0.0, 0.0, 0.3 * (i > 0))),
         "mass": 1.0 + i, "center": (0.01 * i, 0.02, 0.15), "inertia": (0.02, 0.03, 0.01)}
        for i in range(n)
    ]  # fmt: skip
    return dyn.serial_arm(links)


def floating():
    return dyn.Mechanism(
        [dyn.Body("craft", dyn.Joint("free"), mass=2.0, center=(0.1, 0.0, 0.2), inertia=(0.3, 0.2, 0.1))]
    )


@cache
def equations_of(model):
    """With a block on what the formulation by definition has too much."""
    return model_equations(MODELS[model](), compare=("by_definition",))


MODELS = {name: lambda name=name: dyn.scenes.load(name) for name in dyn.scenes.names()} | {
    make.__name__: lambda make=make: dyn.scenes.of_model(make())
    for make in (pulley, cart_pole, hoop, relativistic, floating, rod, sleigh, four_bar)
} | {
    "arm of 3": lambda: dyn.scenes.of_model(dyn.planar_arm([1.0, 0.8, 0.7], [1.0, 0.8, 0.7])),
    "spatial arm of 3": lambda: dyn.scenes.of_model(spatial_arm(3)),
    "spatial arm of 7": lambda: dyn.scenes.of_model(spatial_arm(7)),
    "first order": lambda: dyn.scenes.of_model(
        dyn.OdeSystem(lambda x, t, p: [x[1] * p["k"], -(cg.sin(x[0]) ** 3) - x[1] / 3.0], ["a", "theta"], {"k": 2.0})
    ),
}  # fmt: skip


def computed(found, known):
    """The values of all left sides of lines of text; those of a matrix as lists."""
    known = dict(known)
    rows = []
    for left, right in found.equations:
        if left:
            rows.append([left, right])
        else:
            rows[-1][1] += f" {right}"
    while rows:  # a sum may stand above its parts
        ready = [row for row in rows if not set(re.findall(r"[nv]_?\w+", row[1])) & {each[0] for each in rows}]
        assert ready, rows
        for left, right in ready:
            name, _, middle = left.partition(" = ")
            text = middle if name.startswith("n_z") else right  # of a constraint, which is 0
            if not re.search(r"\bn_(tau|qdd|qd)\b", f"{left} {right}"):  # the equation in general, of vectors
                known[name] = eval(
                    text.replace("^", "**").replace("≤", "<="), {"__builtins__": {}, **FUNCTIONS, **MORE}, known
                )
        rows = [row for row in rows if row not in ready]
    return known


MORE = {"where": lambda c, a, b: a if c else b, "minimum": min, "sign": lambda a: math.copysign(1.0, a)}
SYMBOLS = plain(ALL_DIGITS)._replace(names=lambda names: {name: "n_" + re.sub(r"\W", "_", name) for name in names})


MATHML = NOTATION._replace(
    number=partial(NOTATION.number, digits=ALL_DIGITS),
    names=lambda names: {name: f"<mi>n_{re.sub(r'[^A-Za-z0-9_]', '_', name)}</mi>" for name in names},
    unnamed="<mi>v{}</mi>".format,
)
SIGNS = {"−": "-", "·": "*", "\u2062": "*", "=": " = "}


def python_of(element: ElementTree.Element) -> str:
    """MathML as Python: what stands in the elements of a formula, and nothing else."""
    inside = [python_of(child) for child in element]
    if element.tag == "mo":
        return SIGNS.get(element.text, element.text)
    if element.tag in ("mi", "mn"):
        return element.text
    if element.tag in ("mtable", "mtr"):
        return f"[{', '.join(inside)}]"
    if inside and inside[0] == inside[-1] == "|":
        return f"abs({''.join(inside[1:-1])})"
    forms = {"mfrac": "(({})/({}))", "msup": "(({})**({}))", "msqrt": "sqrt({})"}
    if element.tag in forms:
        return forms[element.tag].format(*(inside if element.tag != "msqrt" else ["".join(inside)]))
    assert element.tag in ("mrow", "mtd"), element.tag
    return "".join(inside)


def lines_of_mathml(block):
    """The lines of a block as MathML has them, in Python."""
    found = statements(block.statements, MATHML, lines=MANY)
    read = [tuple(python_of(ElementTree.fromstring(f"<mrow>{side}</mrow>")) for side in row) for row in found.equations]
    return found._replace(equations=read)


def values_of(equations: Equations, point: dict[str, float], mathml: bool = False) -> list[dict[str, float]]:
    """What each block says at a point of the graphs' names; a left side has the name that the block gives it."""
    said = []
    for block in equations.blocks:
        found = lines_of_mathml(block) if mathml else statements(block.statements, SYMBOLS, lines=MANY)
        assert not found.left_out
        said.append(computed(found, {f"n_{re.sub(r'[^A-Za-z0-9_]', '_', name)}": x for name, x in point.items()}))
    return said


def points(scene):
    """Two random states, with all that graphs of the scene have as inputs."""
    rng = np.random.default_rng(0)
    if scene.ode is not None:
        names = [*scene.coordinates, "t"]
    else:
        n, nq = scene.system.n, scene.system.nq
        names = [f"q{i}" for i in range(nq)] + [f"{kind}{i}" for kind in ("qd", "qdd", "tau", "p") for i in range(n)]
    for _ in range(2):
        yield {
            name: float(x) for name, x in zip([*names, "t"], rng.uniform(0.3, 1.0, len(names) + 1), strict=True)
        } | dict(scene.parameters)


def agrees(said, expected, point):
    """expected: a graph, or what is had as {name: value}."""
    if isinstance(expected, cg.Graph):
        expected = expected.evaluate({name: point[name] for name in expected.input_names})
    scale = max([abs(float(x)) for x in expected.values()])
    for name, value in expected.items():
        assert said[f"n_{name}"] == pytest.approx(float(value), rel=CLOSE, abs=CLOSE * scale), name


@each_row("model", list(MODELS))
def test_the_lines_compute_what_the_graphs_do(model):
    """At the accelerations and multipliers of the graph, the torques that are printed are those that it was given."""
    scene, equations = MODELS[model](), equations_of(model)
    solved = model_equations(scene, of="accelerations")
    for point, mathml in zip(points(scene), (False, True), strict=True):
        moved = {}
        if scene.ode is None:
            forward = dyn.forward_dynamics(scene)
            moved = forward.evaluate({name: point[name] for name in forward.input_names})
        values = values_of(equations, point | moved, mathml)
        blocks = {block.title: said for block, said in zip(equations.blocks, values, strict=True)}
        if scene.ode is not None:
            agrees(blocks["State equation"], state_equation(scene), point)
            continue
        system = scene.system
        lagrangian = system.graph({"L": system.lagrangian}, system.q, system.qd)
        said = blocks["Lagrangian"]
        parts = [value for name, value in said.items() if re.fullmatch(r"n_L_\d+", name)]
        whole = lagrangian.evaluate({name: point[name] for name in lagrangian.input_names})["L"]
        assert said.get("n_L", sum(parts)) == pytest.approx(float(whole), rel=CLOSE, abs=CLOSE)
        if parts:
            assert sum(parts) == pytest.approx(float(whole), rel=CLOSE, abs=CLOSE)
        agrees(blocks["Momenta, p = ∂L/∂q̇"], momentum(scene), point)
        rows = constraint_rows(system, system.constraints.rates)
        if len(system.constraints):
            known = (*system.constraints.positions, *system.constraints.velocities)
            held = system.graph({f"z{k}": known[k] for k in rows.kept}, system.q, system.qd)
            agrees(blocks["Constraints"], held, point)
        blocks |= dict(zip([each.title for each in solved.blocks], values_of(solved, point, mathml), strict=True))
        taus = {f"tau{i}": point[f"tau{i}"] for i in range(system.n)}
        for title, said in blocks.items():
            if title == "Accelerations" or title.startswith("Torque, "):
                agrees(said, moved if title == "Accelerations" else taus, point)
        for title in ("Torque by matrices", "Accelerations by matrices"):
            if title in blocks:
                by_matrices(blocks[title], scene, rows.kept, point | moved)
        assert {"Accelerations", "Accelerations by matrices"} & {*blocks}


def by_matrices(said, scene, kept, point):
    """tau = M qdd + c + g + d - Q - J^T lambda, and J qdd = r, of what the block says."""
    n, taken = scene.system.n, scene.parameters
    letter = {name: next(f"n_{each}" for each in some if each not in taken) for name, some in LETTERS.items()}
    if letter["M"] in said:
        mass = np.array(said[letter["M"]])
    else:
        mass = np.array([[said[f"n_M_{max(i, j)}_{min(i, j)}"] for j in range(n)] for i in range(n)])
    qdd, rows = np.array([point[f"qdd{i}"] for i in range(n)]), np.reshape(said.get(letter["J"], []), (-1, n))
    tau = mass @ qdd - rows.T @ [point[f"lambda{k}"] for k in kept]
    for name, sign in (("c", 1.0), ("g", 1.0), ("d", 1.0), ("Q", -1.0)):
        tau = tau + sign * np.ravel(said.get(letter[name], np.zeros(n)))
    assert tau == pytest.approx([point[f"tau{i}"] for i in range(n)], rel=CLOSE, abs=CLOSE * np.abs(tau).max())
    if letter["r"] in said:
        assert rows @ qdd == pytest.approx(np.ravel(said[letter["r"]]), rel=CLOSE, abs=CLOSE)


@each_row("formulation", dyn.FORMULATIONS)
def test_the_torque_of_every_formulation_has_the_forces_of_constraints(formulation):
    rod = dyn.System(
        lambda q, qd, t: 0.5 * (qd[0] ** 2 + qd[1] ** 2) - q[1], "x y",
        constraints=lambda q, t: {"rod": q[0] ** 2 + q[1] ** 2 - 1.0},
    )  # fmt: skip
    text = equations_text(model_equations(dyn.scenes.of_model(rod), formulation=formulation), ALL_DIGITS)
    assert "tau.x = qdd.x - 2 * q.x * lambda.rod" in text


@each_row("model", ["spring_mass", "cart_pole", "hoop", "arm of 3", "relativistic"])
def test_the_spurious_term_is_what_the_formulations_differ_by_as_dt_tends_to_0(model):
    """Against the graphs themselves at a small step, to the order of the step."""
    scene = MODELS[model]()
    system, right = scene.system, inverse_dynamics(scene, "chain_rule")
    for formulation in ("by_definition", "kinetic_only"):
        equations, wrong = model_equations(scene, formulation=formulation), inverse_dynamics(scene, formulation)
        titles = [block.title for block in equations.blocks]
        for point in points(scene):
            held = point | {"dt": 1e-7}
            held |= {f"q{i}_old": point[f"q{i}"] - 1e-7 * point[f"qd{i}"] for i in range(system.n)}
            held |= {f"qd{i}_old": point[f"qd{i}"] - 1e-7 * point[f"qdd{i}"] for i in range(system.n)}
            off, tau = (graph.evaluate({name: held[name] for name in graph.input_names}) for graph in (wrong, right))
            differences = np.array([float(off[name]) - float(tau[name]) for name in tau])
            said = np.zeros(system.n)
            if equations.blocks[-1].wrong:
                values = values_of(equations, held | {f"tau_def{i}": 0.0 for i in range(system.n)})[-1]
                for i in range(system.n):
                    said[i] = values.get(f"n_tau_def{i} - n_tau{i}", 0.0)
            assert differences == pytest.approx(said, abs=1e-5 * max(1.0, np.abs(said).max())), titles


@each_row("model", ["spring_mass", "triple_pendulum", "pulley"])
def test_hamilton_s_equations_are_those_of_the_graph(model):
    scene = MODELS[model]()
    equations = model_equations(scene, of="momenta")
    assert equations.blocks[-1].title == "Hamilton's equations"
    for point in points(scene):
        agrees(values_of(equations, point)[-1], hamilton_equations(scene), point)


@each_row("model", list(MODELS))
def test_mathml_and_latex_have_the_lines_of_the_text(model):
    """Alike in number, well formed, and short where a model is large."""
    equations = equations_of(model)
    page = equations_html(equations)
    assert len(page) < 100_000
    ElementTree.fromstring(f"<div>{page.replace('&nbsp;', ' ')}</div>")
    text, latex = equations_text(equations, MANY), equations_latex(equations, MANY)
    assert "left out" not in text
    assert latex.count(r"\begin{aligned}") == len(equations.blocks)
    for block in equations.blocks:
        whole = typeset(block.statements, equations.names, MANY)
        found = statements(block.statements, LATEX, equations.names, MANY)
        assert whole.count("<mo>=</mo></mtd>") == sum([bool(left) for left, _ in found.equations])
        assert whole.count("<math") == 1


def test_a_sum_has_no_doubled_sign_and_a_name_no_space():
    for name in MODELS:
        text = equations_text(equations_of(name), 200)
        lines = [line for line in text.splitlines() if line.startswith("  ") and not line.startswith("  (")]
        assert not [line for line in lines if re.search(r"[-+] -|\+ \(-|\w \w", line.replace(" = ", "="))], name


@each_row(
    "model, line",
    [
        ("spring_mass", "  L = 0.5 * I * qd.theta^2 - 0.5 * k * q.theta^2"),
        ("hoop", "  tau.theta = m * R^2 * qdd.theta - 0.5 * m * R^2 * Omega^2 * sin(2 * q.theta) + m * sin(q.theta)"),
        ("cart_pole", "  p.x = (M + m) * qd.x + m * l * cos(q.theta) * qd.theta"),
        ("cart_pole", "  tau.theta = m * l * cos(q.theta) * qdd.x + m * l^2 * qdd.theta - m * l * g * sin(q.theta)"),
        ("cart_pole", "  H = [[M + m, m * l * cos(q.theta)], [m * l * cos(q.theta), m * l^2]]"),
        ("first order", "  a_dot = k * theta"),
        ("triple_pendulum", "Indices: 1 is joint 1, 2 is joint 2, 3 is joint 3."),
    ],
)  # fmt: skip
def test_an_equation_is_that_of_a_textbook(model, line):
    assert line in equations_text(equations_of(model), 200).splitlines()


def test_what_is_left_out_is_said():
    equations = equations_of("spatial arm of 7")
    assert "lines are left out; see --lines: those of " in equations_text(equations, 3)
    page = equations_html(equations, 3)
    assert "lines are left out: those of" in page
    assert "<code>cgraph equations</code> prints all." in page


@each_row(
    "arguments, status, said",
    [
        ("equations spring_mass", 0, "tau.theta = I * qdd.theta + k * q.theta"),
        ("equations spring_mass --formulation by_definition", 1, "By definition, the torque is wrong"),
        ("equations spring_mass --formulation by_definition", 1, "tau.theta = dL / dq.theta = -k * q.theta"),
        ("equations spring_mass --forward", 0, "qdd.theta = (tau.theta - k * q.theta) / I"),
        ("equations spring_mass --momentum", 0, "p_dot.theta = tau.theta - k * q.theta"),
        ("equations triple_pendulum --latex", 0, r"\begin{pmatrix}"),
        ("equations triple_pendulum --digits 3", 0, "Numbers are rounded to 3 digits; see --digits."),
    ],
)  # fmt: skip
def test_the_command_prints_equations_and_the_verdict(capsys, arguments, status, said):
    assert cli.main(arguments.split()) == status
    assert said in capsys.readouterr().out


def test_a_first_order_system_has_no_formulations(capsys, tmp_path):
    (tmp_path / "decay.py").write_text("import dynamics as dyn\nx = dyn.OdeSystem(lambda x, t: [-x[0]], ['x'])\n")
    assert cli.main(["equations", f"{tmp_path / 'decay.py'}:x"]) == 0
    assert "x_dot = -x" in capsys.readouterr().out
    assert cli.main(["equations", f"{tmp_path / 'decay.py'}:x", "--formulation", "chain_rule"]) == 2
    assert "is a system of first order: it has no torque, so no --formulation of it" in capsys.readouterr().err
