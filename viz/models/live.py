"""The page on which a model moves live: computed in the page, as it is watched."""

from __future__ import annotations

import os

from cgraph.extend import write_files
from dynamics import scenes
from dynamics.integrators import TABLEAUS
from dynamics.scenes.live_graphs import live_graphs
from dynamics.scenes.start import Start, moving_start, with_start
from dynamics.systems.model import Model

from ..inspector import Panel
from ..live import EVALUATION, Live, page_text, panel
from ..pages.html import Page
from ..pages.html_target import html_target


def live_page(model: Model, path: str | os.PathLike[str] | None = None, *, start: Start | None = None) -> Page:
    """The page on which a model moves as it is watched, computed there: one HTML file that loads nothing.

    Sliders and fields set the state, the torques, the parameters and dt; of a small mechanism without parameters,
    masses and gravity are some. Meters show energies, momenta, torques and the error of the steps; beside the motion
    is the same one by much shorter steps. A link holds the whole state.

    Parameters
    ----------
    model : Model
        A System, a Mechanism or a Scene.
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
        For what is no model, and for a system of first order, which has no Lagrangian.
    ValueError
        For a path that does not end in .html, or a start that does not fit.
    OSError
        For a path that cannot be written.

    Examples
    --------
    >>> import dynamics as dyn
    >>> import viz
    >>> page = viz.live_page(dyn.planar_arm([1.0], [1.0]), start={"joint 1": 1.0})
    >>> "wasm-unsafe-eval" in page, len(page.encode()) < 50_000
    (True, True)
    """
    target = html_target("the page's file", path)
    scene = scenes.of_model(model)
    scene = moving_start(scene) if start is None else with_start(scene, start)
    text = page_text(live_of(scene), title=f"{scene.name}, live", about=scene.about)
    if target is not None:
        write_files({target: text})
    return text


def live_of(scene: scenes.Scene, *, momentum: bool = False) -> Live:
    """What the panel of a scene computes."""
    graphs = live_graphs(scene, momentum=momentum)
    return Live(*graphs[:7], TABLEAUS, *graphs[7:])


def live_panel(scene: scenes.Scene, *, momentum: bool = False) -> Panel:
    """The motion of a scene as a panel at the end of another page, closed at first."""
    live = panel(live_of(scene, momentum=momentum))
    return Panel(style=live.style, run=live.script, end=live.folded(), allowed=EVALUATION, data=live.data)
