"""The theme: names in mathematical letters, an order of tags, and colors that mean one thing."""

from tests.each_row import each_row
from viz import theme


@each_row(
    ("name", "shown"),
    [
        ("q0", "q₀"),
        ("qd12", "q̇₁₂"),
        ("tau2", "τ₂"),
        ("theta", "θ"),
        ("dL/dqd0", "dL/dq̇₀"),
        ("q0_dot", "dq₀/dt"),
        ("qd1_dot", "dq̇₁/dt"),
        ("left p0_dot", "left dp₀/dt"),
        ("x_dot", "x_dot"),  # a tangent in general
        ("q_dot_max", "q_dot_max"),
        ("dt", "dt"),
    ],
)
def test_names_are_shown_in_mathematical_letters(name: str, shown: str) -> None:
    assert theme.pretty(name) == shown


def test_different_names_of_the_dynamics_stay_different() -> None:
    names = [
        f"{word}{i}{end}" for word in ("q", "qd", "qdd", "tau", "p") for i in range(12) for end in ("", "_dot", "_bar")
    ]
    assert len({theme.pretty(name) for name in names}) == len(names)


def test_no_role_and_no_tag_has_the_color_of_the_spurious() -> None:
    used = {paint.line for paint in theme.ROLES.values()} | {paint.fill for paint in theme.ROLES.values()}
    assert theme.SPURIOUS not in used | set(theme.SERIES)


def test_link_10_comes_after_link_9() -> None:
    tags = ["link 10", "link 9", "base", "link 1"]
    assert sorted(tags, key=theme.natural_order) == ["base", "link 1", "link 9", "link 10"]
