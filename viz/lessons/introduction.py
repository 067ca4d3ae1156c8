"""Introduction of a lesson: the system, its numbers with units, the notation, and what Lagrange's equation asks."""

from html import escape
from math import cos, sin

from ..pages.document import Table
from ..pages.mathml import equations
from .glossary import term
from .subject import SHOWN, Subject, lagrangian_graph, number

MINUTES = 3
_KNOWN = (
    "<p><b>A case that you know:</b> a mass m that is lifted, at the height y. Its L is ½ m ẏ² − m g y, its momentum "
    "p = ∂L/∂ẏ = m ẏ, and ∂L/∂y = −m g. So Lagrange’s equation says τ = m ÿ + m g: the force that accelerates it and "
    "carries its weight.</p>"
)
_HEIGHT, _MARGIN = 200.0, 28.0  # px of the picture


def introduction(subject: Subject) -> str:
    """The first part of a lesson, or of a worksheet, as HTML."""
    name = escape(subject.shown("q0"))
    force = term("torque") if subject.force == "torque" else term("generalized force", subject.force)
    formula = equations(lagrangian_graph(subject.system), subject.names)
    meant = (
        f"<p>The system: {escape(subject.scene.about.rstrip('.'))}.</p>"
        f"<p>Names: <b>{name}</b> is a {term('coordinate')}, <b>{escape(subject.shown('qd0'))}</b> its "
        f"{term('velocity')} dq/dt, read “q dot”, and <b>{escape(subject.shown('qdd0'))}</b> its {term('acceleration')}, “q two dots”. "
        "Throughout the lesson the system is looked at in one moment, in which it moves:</p>"
    )
    asked = (
        f"<p><b>What is asked:</b> which {force} τ makes the system accelerate just so? "
        f"{term('Lagrange’s equation')} answers it, one line for each {subject.joint}:</p>"
        '<p class="display"><b>τ = dp/dt − ∂L/∂q,</b> &nbsp; where p = ∂L/∂q̇ is the '
        f"{term('momentum')}.</p>"
        f"<p>∂L/∂q is a {term('partial derivative')}: how fast L changes with q while everything else, q̇ too, is held. "
        f"L is the {term('Lagrangian')}, {term('kinetic energy')} minus {term('potential energy')}. For this system:</p>"
        + formula
        + ("<p>A v with a number is a part of L that is computed first.</p>" if "<mi>v</mi>" in formula else "")
        + _KNOWN
    )
    rows = [[each, number(value)] for each, value in subject.system.parameters.items()]
    parameters = Table("Parameters, numbers that stay", ["name", "value"], rows[:SHOWN]).html() if rows else ""
    two_link = subject.names and subject.units and subject.scene.mechanism is None
    picture = _arm(*map(float, subject.q)) if two_link else ""
    return meant + picture + _moment(subject) + parameters + asked


def _moment(subject: Subject) -> str:
    """Coordinates, velocities and accelerations; of a ball or a free joint these have rows of their own."""
    system = subject.system
    kinds = (("q", system.nq), ("qd", system.n), ("qdd", system.n))
    names = [f"{kind}{i}" for kind, many in kinds for i in range(min(many, SHOWN))]
    rows = [[subject.shown(name), f"{number(subject.values[name])}{subject.unit(name)}"] for name in names]
    header = ["quantity", "value"]
    if system.nq == system.n:
        shown = min(system.n, SHOWN)
        rows = [[cell for row in rows[i::shown] for cell in row] for i in range(shown)]
        header = ["coordinate", "value", "velocity", "value", "acceleration", "value"]
    table = Table("This moment", header, rows).html()
    told = bool(subject.units or subject.scene.about)
    units = (
        "" if told else "<p>The numbers have no units here: any that fit one another will do, such as those of SI.</p>"
    )
    units += f"<p>{_chosen(subject)}</p>"
    more = system.n - SHOWN
    return table + units + (f"<p>{more} more {'is' if more == 1 else 'are'} not shown.</p>" if more > 0 else "")


def _chosen(subject: Subject) -> str:
    """Sentence on what of this moment is the model's own start, and what the lesson has put in its place."""
    scene = subject.scene
    starts = {"q": [*subject.q] == [*scene.q], "q̇": [*subject.qd] == [*scene.qd], "q̈": False}
    kept, chosen = (" and ".join([name for name, own in starts.items() if own is kind]) for kind in (True, False))
    is_kept = f" {kept} {'are those' if ' and ' in kept else 'is that'} of the model’s start." if kept else ""
    chosen = chosen.replace(" and ", ", ", max(0, chosen.count(" and ") - 1))
    return f"The lesson has chosen {chosen}, so that every {subject.joint} moves.{is_kept}"


def _arm(shoulder: float, elbow: float) -> str:
    """A drawing of the two-link arm: links of length 1, angles from hanging straight down."""
    scale = (_HEIGHT - 2 * _MARGIN) / 2.0
    places = [(0.0, 0.0)]
    for angle in (shoulder, shoulder + elbow):
        x, y = places[-1]
        places.append((x + sin(angle), y + cos(angle)))
    (x0, y0), (x1, y1), (x2, y2) = [(40.0 + scale * x, _MARGIN + scale * y) for x, y in places]
    x, y = x1 + 0.8 * scale * sin(shoulder), y1 + 0.8 * scale * cos(shoulder)
    return (
        f'<svg class="arm" viewBox="0 0 330 {_HEIGHT:g}" role="img" aria-label="The arm hangs from the shoulder; each angle '
        'is measured from straight on">'
        f'<line class="dashed" x1="{x0:.1f}" y1="{y0:.1f}" x2="{x0:.1f}" y2="{y0 + scale:.1f}"/>'
        f'<line class="dashed" x1="{x1:.1f}" y1="{y1:.1f}" x2="{x:.1f}" y2="{y:.1f}"/>'
        f'<polyline points="{x0:.1f},{y0:.1f} {x1:.1f},{y1:.1f} {x2:.1f},{y2:.1f}"/><circle cx="{x0:.1f}" cy="{y0:.1f}" r="5"/>'
        f'<circle class="mass" cx="{x1:.1f}" cy="{y1:.1f}" r="8"/><circle class="mass" cx="{x2:.1f}" cy="{y2:.1f}" r="8"/>'
        f'<text x="{x0 + 12:.1f}" y="{y0 + 4:.1f}">shoulder, fixed</text>'
        f'<text x="4" y="{y0 + scale + 16:.1f}">q.shoulder</text>'
        f'<text x="{x1 + 14:.1f}" y="{y1 - 4:.1f}">elbow, 1 kg</text>'
        f'<text x="{x - 20:.1f}" y="{y + 16:.1f}">q.elbow</text>'
        f'<text x="{x2 + 14:.1f}" y="{y2 + 5:.1f}">1 kg</text></svg>'
        "<p>q.shoulder is measured from straight down, q.elbow from the way in which the upper link points.</p>"
    )
