"""Figure 7, of our own: both forms of the equations of motion by depth, and what the paper expects of the second."""

from collections.abc import Callable, Mapping

from cgraph import Graph
from dynamics import Mechanism, hamilton_equations, scenes, state_equation

from .. import theme
from ..graph_drawing.legend import kinds_in, legend_svg, to_adaptive
from ..graph_drawing.levels import Scale, levels_svg, silhouettes_svg
from ..pages.document import Block, Paragraph, Picture, Table
from .both_forms import HAMILTON, LAGRANGE, SIZES, VELOCITIES_ALONE, both_forms, form_sizes, size_of
from .mechanisms import binary_tree, chain, turned_arm
from .part import Part, drawn

Forms = Mapping[str, Mapping[str, int]]  # of both forms, or orders of elimination: their sizes, as of `form_sizes`
TITLES = {LAGRANGE: "Lagrange: accelerations of (θ, ω)", HAMILTON: "Hamilton: rates of (θ, p)"}
SPRING, ARM = "a rotor on a spring", "the three-link arm"
LARGER: dict[str, Callable[[], Mechanism]] = {
    "a planar chain of 20": lambda: chain(0.2, 0.2, 20),
    "an arm of 7 in space": lambda: turned_arm(7),
    "a tree of 15": lambda: binary_tree(15),
}
LARGE_SCALE = Scale(
    row=68.0,
    gap=62.0,
    width=48.0,
    height=30.0,
    names={**theme.ONE_JOINT, "p0": "p", "q0_dot": "dθ/dt", "qd0_dot": "dω/dt"},
)
SMALL_SCALE = Scale(row=15.0, gap=13.0, width=8.0, height=8.0, ticks=5)
LINKS = 50  # of the chain that is drawn as a silhouette
SILHOUETTES = (
    f"Figure 7c. Not in the paper: a planar chain of {LINKS} links in both forms and both orders of elimination. A row for each "
    "operation on the longest path to a node, as wide as there are nodes on it: areas are numbers of nodes, in the "
    "colors of Figure 7. Towers that are high and narrow leave a machine little to do at the same time."
)


def figure7(larger: Mapping[str, Callable[[], Mechanism]] = LARGER) -> Part:
    """Figure 7: a rotor on a spring and the three-link arm in both forms, a row for each operation of depth.

    And the silhouettes of a long chain in both orders of elimination.  larger: mechanisms whose sizes are counted as well.
    """
    shown = {SPRING: both_forms(scenes.load("spring_mass")), ARM: both_forms(scenes.load("triple_pendulum"))}
    sizes = {name: form_sizes(forms) for name, forms in shown.items()}
    sizes |= {name: form_sizes(both_forms(make())) for name, make in larger.items()}
    titled = {name: {TITLES[form]: graph for form, graph in forms.items()} for name, forms in shown.items()}
    spring = levels_svg(titled[SPRING], LARGE_SCALE)
    solved = {"ω is solved": sizes[ARM][VELOCITIES_ALONE]["depth"]}
    arm = levels_svg(titled[ARM], SMALL_SCALE, {TITLES[HAMILTON]: solved})
    kinds = kinds_in(*shown[SPRING].values(), *shown[ARM].values())
    kinds.remove(theme.OUTPUT)  # a ring around a node here, as the captions say
    legend = legend_svg(theme.in_words(kinds, theme.MOTION_WORDS), 1)
    long, orders = chain(0.1, 0.1, LINKS), dict[str, Graph]()
    for method in ("recursive", "balanced"):
        orders |= {f"Lagrange, {method}": state_equation(long, method)}
        orders |= {f"Hamilton, {method}": hamilton_equations(long, method)}
    order_sizes = {title: size_of(graph) for title, graph in orders.items()}
    each = [f"{title} {size['nodes']} nodes, {size['depth']} deep" for title, size in order_sizes.items()]
    towers = f"Four towers over one scale of depth: {'; '.join(each)}."
    silhouettes = silhouettes_svg(orders)
    rows = [
        (f"{name}, {title.partition(':')[0]}", *map(str, forms[form].values()))
        for name, forms in sizes.items()
        for form, title in TITLES.items()
    ]
    blocks: list[Block] = [
        Paragraph(_answer(sizes[ARM]), point=True),
        drawn("fig7a", spring, _caption("7a", SPRING, sizes[SPRING]), "auto", _seen(SPRING, sizes[SPRING])),
        Picture("", to_adaptive(legend), "The colors of Figure 7.", "auto"),
        drawn("fig7b", arm, _caption("7b", ARM, sizes[ARM]), "100%", _seen(ARM, sizes[ARM])),
        Paragraph(_cause(sizes[ARM])),
        Table("Sizes of both forms", ("", *SIZES), rows, file="fig7"),
        Paragraph(_remedy(order_sizes)),
        drawn("fig7c", silhouettes, SILHOUETTES, "100%", towers),
    ]
    data = sizes | {f"a planar chain of {LINKS}": order_sizes}
    return Part("forms", "Figure 7: both forms by depth", blocks, {"forms": data})


def _caption(number: str, what: str, forms: Forms) -> str:
    lagrange, hamilton = forms[LAGRANGE], forms[HAMILTON]
    thick = "One of the longest paths is thick; a ring is around an output, and lines from constants are left out."
    return (
        f"Figure {number}. Not in the paper: both forms of {what}, a row for each operation on the longest path to a node, the same rows for "
        f"both: {lagrange['depth']} operations deep by accelerations, {hamilton['depth']} by momenta. {thick}"
    )


def _seen(what: str, forms: Forms) -> str:
    each = [
        "{} {nodes} nodes and {edges} edges, {depth} deep and {width} wide".format(title, **forms[form])
        for form, title in TITLES.items()
    ]
    return f"Two graphs of {what} side by side, inputs at the bottom: {'; '.join(each)}."


def _answer(forms: Forms) -> str:
    lagrange, hamilton = forms[LAGRANGE], forms[HAMILTON]
    compact, parallel = ("yes" if hamilton[size] < lagrange[size] else "no" for size in ("nodes", "depth"))
    return (
        "Section 5 of the paper leaves the Hamiltonian graph to future work, and expects of it parallelism in place of "
        "depth, and a more compact graph. "
        f"More compact: {compact}, {hamilton['nodes']} nodes in place of {lagrange['nodes']}. "
        f"More parallel: {parallel}, {hamilton['depth']} operations deep in place of {lagrange['depth']}."
    )


def _cause(forms: Forms) -> str:
    level = forms[VELOCITIES_ALONE]["depth"]
    return (
        "The cause can be seen. ∂L/∂θ is taken at ω, so ω has to be solved from p first, by the elimination that "
        f"otherwise gives the accelerations, {level} operations deep; the momenta of the links then go from the tip to the "
        f"base once more, {forms[HAMILTON]['depth'] - level} further. For accelerations the bias is computed in parallel with the factors of "
        "the elimination, not after them. First or second order makes no difference: both are deep because links "
        "are eliminated one after another. A rotor alone has nothing to eliminate, and is less deep by momenta. Times "
        "and longer chains are in docs/hamiltonian.md, “The momentum graph”."
    )


def _remedy(orders: Forms) -> str:
    nodes, depths = ({title: size[of] for title, size in orders.items()} for of in ("nodes", "depth"))
    return (
        "A balanced order of elimination makes the graph parallel: it reduces pieces of the chain to their two ends, all at the "
        "same time, and joins them in pairs. Of the depth of either form there remain one or two operations for each link, "
        "of the sums along the chain: "
        f"{depths['Lagrange, balanced']} and {depths['Hamilton, balanced']} operations in place of "
        f"{depths['Lagrange, recursive']} and {depths['Hamilton, recursive']}, for "
        f"{nodes['Lagrange, balanced'] / nodes['Lagrange, recursive']:.1f} and "
        f"{nodes['Hamilton, balanced'] / nodes['Hamilton, recursive']:.1f} times the nodes."
    )
