"""Equation (3) and Figures 1 to 3: one rotor on a spring, by the three formulations."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from cgraph import Graph
from cgraph._shared import Json, Polynomial, expand, format_polynomial
from dynamics import formulation_sizes, formulation_verdict, inverse_dynamics, momentum_rate, scenes
from dynamics.equations.formulations.formulation_sizes import INERTIAL_TERM, PAPER as FORMULATIONS, blamed

from .. import theme
from ..graph_drawing.dot import plain_drawing
from ..graph_drawing.legend import kinds_in, legend_svg, to_adaptive
from ..graph_drawing.render import render_svg
from ..pages.document import Block, Markup, Paragraph, Picture
from ..pages.formulation_table import TITLES, WHY_FEWER, size_table
from .part import Part, drawn
from .stage import Stage, View, spoken, stage_html, subscripts, view_of
from .typeset import row, terms, typeset

SCENE = "spring_mass"
LETTERS = {**theme.ONE_JOINT, "q0_old": "θ_old", "qd0_old": "ω_old"}  # in a line of text
# The paper's right-hand side, I qdd - k (qdd dt^2 + 2 qd dt + q_old), as coefficients.
PAPER: Polynomial = {
    (("I", 1), ("qdd0", 1)): 1.0,
    (("dt", 2), ("k", 1), ("qdd0", 1)): -1.0,
    (("dt", 1), ("k", 1), ("qd0", 1)): -2.0,
    (("k", 1), ("q0_old", 1)): -1.0,
}


def terms_of(graph: Graph, whole: Sequence[str] = ("qd0",)) -> Polynomial:
    """The terms of the one output of a graph.

    whole: embedded ones that stand for themselves, qd0 for qdd0 dt + qd0_old, q0 for qd0 dt + q0_old.
    """
    return expand(
        graph.only_output(), {node: str(node.name) for node in graph.nodes if node.args and node.name in whole}
    )


def equations() -> Part:
    """Equation (3), read off the graphs term by term."""
    scene = scenes.load(SCENE)
    forms = {name: terms_of(momentum_rate(scene, name)) for name in FORMULATIONS}
    written = {name: format_polynomial(form) for name, form in forms.items()}
    same = forms["by_definition"] == PAPER
    lines = [f"{'paper, Eq. (3)':16} d/dt dL/dqd = {format_polynomial(PAPER)}"]
    lines += [f"{TITLES[name]:16} d/dt dL/dqd = {form}" for name, form in written.items()]
    lines.append(f"By definition, the graph has the paper's terms, all of them and no other: {'yes' if same else 'NO'}")
    graphs = {name: inverse_dynamics(scene, name) for name in FORMULATIONS}
    torques = {name: format_polynomial(terms_of(graph)) for name, graph in graphs.items()}
    sums = {name: terms_of(graph, ("q0", "qd0")) for name, graph in graphs.items()}
    lines += ["", "The torque is what Lagrange's equation asks for, tau = d/dt dL/dqd - dL/dq:"]
    lines += [f"{TITLES[name]:16} tau = {torque}" for name, torque in torques.items()]
    lines += [
        "",
        "q0 is the paper's theta, qd0 its omega, qdd0 its alpha, q0_old the angle one step of length dt earlier.",
    ]
    blocks = [Markup(_equations_html(forms, sums, same), "\n".join(lines))]
    data: dict[str, Json] = {"equal_to_paper": same, **written, "torques": torques}
    files = {"equations.txt": "\n".join(lines) + "\n"}
    return Part("equations", "Equation (3), read off the graphs", blocks, {"equations": data}, files)


RATE = row("d/dt ∂L/∂ω")
PAPERS_LINE = (  # Eq. (3) as it is printed, its last line
    f'<math display="block"><mrow>{RATE}{row("= I α −")}<munder><mrow class="wrong">'
    f"{row('k ( α dt^2 + 2 ω dt + θ_old )')}</mrow><mtext>unnecessary terms</mtext></munder></mrow></math>"
)


def _equations_html(forms: Mapping[str, Polynomial], torques: Mapping[str, Polynomial], same: bool) -> str:
    """The section's words and its table, with formulas."""
    right, torque = forms["chain_rule"], torques["chain_rule"]
    rows = [("the paper, Eq. (3), multiplied out", terms(PAPER, right), "")]
    rows += [
        (f"{TITLES[name]}, our graph", terms(form, right), terms(torques[name], torque)) for name, form in forms.items()
    ]
    body = "".join([f"<tr><td>{title}</td><td>{left}</td><td>{total}</td></tr>" for title, left, total in rows])
    rate = f"<math>{RATE}</math>"
    verdict = "the paper's terms, all of them and no other" if same else "NOT the paper's terms"
    return (
        f"<p>A rotor on a spring, Section 2.1 of the paper: {typeset('L = ½ I ω^2 − ½ k θ^2')}, with the angle "
        f"{typeset('θ')}, its rate {typeset('ω')} and the acceleration {typeset('α')}. The inertial term of Lagrange's equation, "
        f"{rate}, is {typeset('I α')} and nothing else. With {typeset('θ = ω dt + θ_old')} embedded in the graph "
        f"the paper finds instead, in its Eq. (3),</p>{PAPERS_LINE}"
        "<p>The lines below are not typed in: each graph is expanded into its terms. "
        f"By definition, our graph has {verdict}.</p>"
        '<div class="scroll" tabindex="0" role="region" aria-label="Equation (3)"><table class="formulas">'
        f"<caption>Terms of the graphs; wrong ones are underlined. In the torque {typeset('θ')} stands for {typeset('ω dt + θ_old')}.</caption>"
        f"<thead><tr><th></th><th>inertial term {rate}</th>"
        f"<th>whole torque {typeset('τ = d/dt ∂L/∂ω − ∂L/∂θ')}</th></tr></thead><tbody>{body}</tbody></table></div>"
        '<p class="point">Differentiating by the velocity also differentiates the spring\'s energy, since '
        f"{typeset('θ')} is computed from {typeset('ω')}. In the whole torque {typeset('− k θ_old')} cancels the correct "
        f"{typeset('k θ')} of {typeset('− ∂L/∂θ')}: as {typeset('dt')} tends to 0 the spring is gone. In the same way an arm "
        "by definition weighs nothing.</p>"
    )


WORDS = {  # file: formulation, what the figure shows, and what is to see in it
    "fig1": (
        "by_definition",
        "By definition, with θ = ω dt + θ_old embedded (Section 2.1).",
        (
            "There by mistake: {wrong_operations} operations and {wrong_edges} edges, in vermillion, by which the spring's energy "
            "enters the momentum. Inputs {alone} serve these alone, and are no mistake themselves."
        ),
    ),
    "fig2": (
        "kinetic_only",
        "The kinetic energy K in place of L in the derivative by the velocity (Section 2.1).",
        "Nothing is there by mistake: no spring in the inertial term, which is right for one joint; ω = α dt + ω_old is still embedded.",
    ),
    "fig3": (
        "chain_rule",
        "The chain rule, dp/dt = ∇p · (ω, α), from the whole L (Section 2.2).",
        "Nothing is there by mistake: no dt, no earlier state and no spring; ω is an input of its own, independent of θ.",
    ),
}


def view(formulation: str) -> View:
    """The inertial term of the rotor on a spring, with its momentum, as it is drawn."""
    graph, wrong = blamed(scenes.load(SCENE), INERTIAL_TERM, formulation)
    return view_of(graph, theme.ONE_JOINT, wrong.nodes, wrong.edges)


def caption(name: str) -> str:
    """The caption of one of Figures 1 to 3, with the numbers of what is drawn."""
    formulation, what, seen = WORDS[name]
    shown = view(formulation)
    count = shown.drawn()
    alone = " and ".join([text.replace(" ", "_") for text in shown.inputs_of_mistakes()])
    return (
        f"Figure {name[3:]}. {what} Drawn are {count['inputs'] + count['operations']} nodes, {count['inputs']} inputs and "
        f"{count['operations']} operations, and {count['edges']} edges; the {count['outputs']} outputs in double frames are "
        f"no nodes, and the {count['output_arrows']} arrows to them no edges. {seen.format(**count, alone=alone)}"
    )


STATE = {"q0": 0.5, "qd0": 1.0, "qdd0": 4.0, "I": 2.0, "k": 3.0}  # rad, rad/s, rad/s^2, kg m^2, N m/rad
NOTES = (
    (theme.LINE, 1.2, "", "an edge: a value goes into an operation"),
    (theme.SPURIOUS, 2.5, "", "an edge that is there by mistake"),
    (theme.LINE, 1.2, "1 2", "first and second argument, 1 − 2"),
)
STEPS = (1.0, *[float(f"{digit}e-{k}") for k in range(1, 7) for digit in (3, 1)])  # s, 1 to 1e-6


def moving_figure() -> tuple[Stage, str]:
    """The three formulations on one layout, with the values of their nodes at each step, and where these are taken."""
    views = {name: view(formulation) for name, (formulation, _, _) in WORDS.items()}
    states = [
        STATE | {"dt": dt, "q0_old": STATE["q0"] - STATE["qd0"] * dt, "qd0_old": STATE["qd0"] - STATE["qdd0"] * dt}
        for dt in STEPS
    ]
    excess = formulation_verdict(scenes.load(SCENE), "by_definition").excess_at(STATE)["tau0"]
    told = (
        f"At θ = {STATE['q0']:g} rad, ω = {STATE['qd0']:g} rad/s and α = {STATE['qdd0']:g} rad/s², with I = {STATE['I']:g} kg m² and "
        f"k = {STATE['k']:g} N m/rad; θ_old and ω_old are what they were one step dt before. What is faint belongs to other figures."
    )
    titles = {name: f"Figure {name[3:]}: {TITLES[formulation]}" for name, (formulation, _, _) in WORDS.items()}
    captions = {name: caption(name) for name in WORDS}
    seen = Stage(views, titles, captions, LETTERS, STEPS, states, "p0_dot", "dp/dt [N\u00a0m]")
    limit = f"By definition {excess:+.3g} N m of it, −k θ, stay however small dt is.".replace("-", "−")
    return seen, f"{told} {limit}"


def figures_1_to_3() -> Part:
    """Figures 1 to 3: the three formulations on one layout, and the sizes of these graphs and of the whole torque."""
    sizes = formulation_sizes(scenes.load(SCENE))
    figures = {name: sizes[INERTIAL_TERM, formulation]._asdict() for name, (formulation, _, _) in WORDS.items()}
    moving, told = moving_figure()
    kinds = [*kinds_in(*[each.graph for each in moving.views.values()]), theme.MARKED]
    legend = legend_svg(kinds, 1, notes=NOTES)
    explained = Picture("legend", to_adaptive(legend), "Shapes, colors and arrows of Figures 1 to 3.", "auto")
    blocks: list[Block] = [
        Markup(stage_html(moving, told, explained), "Figures 1 to 3 on one layout are on the page alone."),
        explained,
    ]
    files: dict[str, str | bytes] = {}
    for name, seen in moving.views.items():
        drawing = plain_drawing(seen.graph, theme.ONE_JOINT, seen.wrong, seen.wrong_edges)
        alt = f"Graph. {spoken(seen.graph, LETTERS)}"
        blocks.append(drawn(name, subscripts(render_svg(drawing)), caption(name), "auto", alt))
        files[f"{name}.dot"] = str(drawing.source)
    blocks += [
        Paragraph(
            "Figures 1 to 3 draw the inertial term dp/dt of Lagrange's equation, τ = dp/dt − ∂L/∂θ, beside the momentum p = ∂L/∂ω. "
            "What the commands “cgraph lint” and “cgraph inspect” look at is the whole torque τ. One function counts both; "
            "there by mistake it counts inputs, too, that serve nothing else."
        ),
        replace(size_table(sizes), caption="Nodes and edges of Figures 1 to 3 and of the whole torque", file="sizes"),
        Paragraph(WHY_FEWER.replace("∂L/∂q", "∂L/∂θ")),
    ]
    counted = {f"{term}, {formulation}": size._asdict() for (term, formulation), size in sizes.items()}
    heading = "Figures 1 to 3: the inertial term, three times"
    moves: dict[str, Json] = {"stage": moving.data()}
    return Part("figures", heading, blocks, {**figures, "sizes": counted}, files, moves)
