"""The page of a model: its equations as graphs along a motion, with the torques of its parts."""

from __future__ import annotations

import os

from cgraph._shared import require_flag, write_files
from dynamics import display_names, scenes
from dynamics.scenes.start import Start, moving_start, rest_text, with_start
from dynamics.systems.model import Model, as_system

from ..inspector import page
from ..pages.html import Page, html_target
from ..typed.text_page import box
from .formulas_panel import formulas_panel
from .inspection import FORWARD, INVERSE, MOMENTUM, Inspection, inspection
from .live_motion import live_panel
from .remarks import tree_alone
from .typed_text import text_or_none

LIVELY = 40  # velocities: larger models have a page of their motion alone, `live`


def inspect(
    model: Model,
    path: str | os.PathLike[str] | None = None,
    *,
    start: Start | None = None,
    t_end: float | None = None,
    forward: bool = False,
    momentum: bool = False,
    title: str | None = None,
) -> Page:
    """The page on which a model's equations unfold, move and answer: one HTML file that loads nothing.

    Parameters
    ----------
    model : Model
        A System, a Mechanism or a Scene; of an OdeSystem the page shows the state equation.
    path : str or path, optional
        The file to write the page to, .html.
    start : mapping of str to float, or sequence of float, optional
        {name: value} of what differs from the model's start, its zero at rest: "q0", "qd.knee" or a coordinate's name;
        or all numbers of q and then qd [rad or m, per second]. By default a model that would rest there for ever
        starts half a radian away.
    t_end : float, optional
        How long it moves [s]; 3 s of what is no scene.
    forward : bool
        Show forward dynamics first, in place of inverse dynamics by definition.
    momentum : bool
        Show Hamilton's equations first, whose state is coordinates and momenta.
    title : str, optional
        Heading of the page, by default what it shows.

    Returns
    -------
    Page
        The HTML text; a notebook shows it in a frame.

    Raises
    ------
    TypeError
        For what is no model.
    ValueError
        For a path that does not end in .html, a start that does not fit, a time that is not positive and finite, or
        both forward and momentum.
    ConstraintError
        With momentum, for a model with constraints.
    OSError
        For a path that cannot be written.

    Examples
    --------
    >>> import dynamics as dyn
    >>> import viz
    >>> page = viz.inspect(dyn.planar_arm([1.0], [1.0]), start={"joint 1": 1.0}, t_end=0.1)
    >>> "joint 1" in page
    True
    """
    target = html_target("the page's file", path)
    require_flag("forward", forward)
    require_flag("momentum", momentum)
    scene = scenes.of_model(model)
    at = moving_start(scene) if start is None else with_start(scene, start)
    view = first_view(forward, momentum)
    content = inspection(at, t_end=t_end)
    moved = rest_text(scene, at) if start is None and at is not scene else ""
    text = inspection_page(at, content, moved, title, view)
    if target is not None:
        write_files({target: text})
    return text


def first_view(forward: bool, momentum: bool) -> str:
    """The group of versions that is shown first. Raises ValueError for both."""
    if forward and momentum:
        raise ValueError("forward and momentum exclude one another: one view is shown first")
    return FORWARD if forward else MOMENTUM if momentum else INVERSE


def inspection_page(
    scene: scenes.Scene, content: Inspection, moved: str = "", title: str | None = None, view: str = INVERSE
) -> Page:
    """The page of a scene.  moved: why its start was chosen for it, if it was.  view: the group that is shown first.

    Raises ValueError for a group that the model has not.
    """
    mechanism, versions = scene.mechanism, list(content.versions.values())
    if view == MOMENTUM and all(each.group != view for each in versions):
        as_system(scene.model)  # a system of first order has no momenta at all
        raise ValueError(f"{scene.name}: {content.lacking}")
    lively = scene.ode is not None or scene.system.n <= LIVELY
    notices = [f"Left out of the model: {'; '.join(scene.left_out)}."] if scene.left_out else []
    notices += [each for each in (tree_alone(scene), content.lacking) if each]
    try:
        motions = [live_panel(scene, momentum=view == MOMENTUM)] if lively else []
    except ValueError as error:  # an operation that no browser has
        motions = []
        notices.append(f"No live motion: {error}.")
    notices += [f"{moved[0].upper()}{moved[1:]}."] if moved else []
    return page(
        versions,
        title=scene.name if title is None else title,
        at=content.at,
        derived=content.derived,
        motion=content.motion,
        tables=[each for each in (content.shares, content.carried) if each],
        names=display_names(scene),
        units=content.units,
        columns={body.name: body.parent for body in mechanism.moving} if mechanism else None,
        causes=content.causes,
        notices=[*notices, *([f"The motion is not whole: it {content.stopped}."] if content.stopped else [])],
        panels=[box(text_or_none(scene, scene.q, scene.qd)), *motions, formulas_panel(scene, momenta=view == MOMENTUM)],
        view=next((each.name for each in versions if each.group == view), ""),
    )
