"""The directive `live`: the live page of a scene in a frame, made as the pages are built; its content is the picture
that stands there where no script runs, and on paper.
"""

from pathlib import Path

from docutils import nodes
from sphinx.util.docutils import SphinxDirective

FRAME = '<iframe class="live-frame" src="_static/{name}" title="Live page: {scene}" loading="lazy"></iframe>'


class Live(SphinxDirective):
    """```{live} SCENE``` on a page of the top folder, and in it the picture."""

    required_arguments = 1
    has_content = True

    def run(self):
        """The frame, and the picture in a box of the class `live-picture`."""
        import dynamics as dyn
        import viz

        scene = self.arguments[0]
        name = f"live-{scene}.html"
        folder = Path(self.env.app.outdir) / "_static"
        folder.mkdir(parents=True, exist_ok=True)
        viz.live(dyn.scenes.load(scene), folder / name)
        picture = nodes.container(classes=["live-picture"])
        picture += self.parse_content_to_nodes()
        return [nodes.raw("", FRAME.format(name=name, scene=scene), format="html"), picture]


def setup(app):
    """Called by Sphinx."""
    app.add_directive("live", Live)
    return {"parallel_read_safe": True}
