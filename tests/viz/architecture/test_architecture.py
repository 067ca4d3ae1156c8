"""The architecture of packages: what is read from their sources, and the command that prints and draws it."""

from __future__ import annotations

import ast
import json
import re
from pathlib import Path

import pytest

from viz import cli
from viz.architecture.architecture import Architecture, folder, of_modules
from viz.architecture.import_rule import PACKAGES, TABLE, may_import
from viz.architecture.imports import Module, imports_of, modules, uses
from viz.architecture.picture import to_dot

PICTURE = Path(__file__).parents[3] / "docs" / "images" / "architecture.svg"


@pytest.fixture(scope="module")
def known() -> dict[str, Module]:
    return modules(PACKAGES)


@pytest.fixture(scope="module")
def library(known: dict[str, Module]) -> Architecture:
    return of_modules(known, PACKAGES)


def package(folder: Path, files: dict[str, str]) -> dict[str, Module]:
    """Modules of these sources, {dotted name: text}; names of packages end in a dot."""
    known = {}
    for name, text in files.items():
        path = folder.joinpath(*name.strip(".").split("."))
        path = path / "__init__.py" if name.endswith(".") else path.with_suffix(".py")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        known[name.strip(".")] = Module(name.strip("."), path)
    return known


def test_imports_are_read_at_any_depth() -> None:
    text = "import a.b, c as x\ndef f():\n  from d.e import g\n  if 1:\n    from ..h import i\n    from .. import j"
    found = [(each.module, each.name, each.bound) for each in imports_of(ast.parse(text), "p.q")]
    assert found == [
        ("a.b", None, "a"), ("c", None, "x"), ("d.e", "g", "g"), ("p.h", "i", "i"), ("p", "j", "j")
    ]  # fmt: skip
    kinds = {each.module: each.for_types for each in imports_of(ast.parse("if TYPE_CHECKING:\n  import a\nimport b"))}
    assert kinds == {"a": True, "b": False}


def test_a_name_leads_to_the_file_in_which_it_is_written(tmp_path: Path) -> None:
    known = package(
        tmp_path,
        {
            "p.": '"""A face."""\nfrom .low import f as g\nfrom .more import METHODS\n__all__ = ["METHODS", "g"]',
            "p.low": "def f(): ...",
            "p.more.": "from .inner import inner\nMETHODS = inner",  # no face: it computes
            "p.more.inner": "inner = 1",
            "p.one": "from p import g\nx = g()",
            "p.two": "import p\nx = p.g()",
            "p.all": "import p\nx = p.g()\nfor name in names:\n  getattr(p, name)",
            "p.three": "from .more import METHODS, inner\nimport numpy\nx = 1",
        },
    )
    assert uses(known) == {
        "p.low": set(),
        "p.more": {"p.more.inner"},
        "p.more.inner": set(),
        "p.one": {"p.low"},
        "p.two": {"p.low"},
        "p.all": {"p.low", "p.more"},
        "p.three": {"p.more", "p.more.inner"},
    }


def test_circles_climbing_arrows_and_loose_modules_are_told(tmp_path: Path) -> None:
    files = {
        "cgraph.": "",
        "cgraph.core.": "",
        "cgraph.core.a": "def f():\n  from ..explain.b import g",
        "cgraph.explain.": "",
        "cgraph.explain.b": "from ..core.a import f\ng = f",
        "cgraph.errors": "x = 1",
    }
    found = of_modules(package(tmp_path, files), ["cgraph"])
    assert found.rooms == ("cgraph.core", "cgraph.explain")
    assert found.climbing == (("cgraph.core.a", "cgraph.explain.b"),)
    assert found.circles == (("cgraph.core", "cgraph.explain"),)
    assert found.file_circles == (("cgraph.core.a", "cgraph.explain.b"),)
    assert found.loose == {"cgraph": ("cgraph.errors",)}
    assert not found.sound
    assert "cgraph.core.a imports cgraph.explain.b" in str(found)
    assert 'color="#D55E00"' in to_dot(found).source


def test_a_room_stands_on_the_floor_above_all_that_it_imports(library: Architecture) -> None:
    for name, floor in library.floors.items():
        below = [library.floors[b] for a, b in library.arrows if a == name and (b, a) not in library.arrows]
        assert floor >= max(below, default=0) + 1
    assert library.floors["cgraph"] == 1
    assert library.floors["viz"] == max(library.floors.values())


def test_an_arrow_is_implied_by_a_longer_way(library: Architecture) -> None:
    assert library.implied(("viz", "cgraph"))
    assert not library.implied(("dynamics.systems", "cgraph"))


def test_the_table_is_an_order_that_names_every_folder(known: dict[str, Module]) -> None:
    folders = {folder(name) for name, module in known.items() if not module.is_face}
    named = {
        f"{package}.{name}" for package in PACKAGES for chain in TABLE[package] for name in re.findall(r"\w+", chain)
    }
    assert named == folders
    for a in folders:
        assert may_import(a, a)
        assert not [b for b in folders - {a} if may_import(a, b) and may_import(b, a)]


@pytest.mark.parametrize(
    ("importer", "imported", "allowed"),
    [
        ("cgraph.explain", "cgraph.core", True),
        ("cgraph.simplification", "cgraph.autodiff", False),
        ("dynamics.peers", "cgraph.explain", True),
        ("cgraph.core", "dynamics.systems", False),
        ("viz.paper", "dynamics.experiments", True),
        ("viz.pages", "dynamics.experiments", False),
        ("viz.pages", "cgraph.core", True),
    ],
)
def test_who_may_import_whom(importer: str, imported: str, allowed: bool) -> None:
    assert may_import(importer, imported) == allowed


def test_the_command_prints_and_draws(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, library: Architecture
) -> None:
    assert cli.main(["architecture", "viz", "--out", str(tmp_path / "viz.dot")]) == 0
    assert "loose modules in viz: viz.__main__, viz.cli, viz.theme" in capsys.readouterr().out
    assert '"viz.cli" -> "viz.commands"' in (tmp_path / "viz.dot").read_text(encoding="utf-8")
    monkeypatch.setattr("viz.commands.library.architecture", lambda package: library)
    assert cli.main(["architecture", "--json"]) == (0 if library.sound else 1)
    assert json.loads(capsys.readouterr().out) == library.to_dict()
    assert cli.main(["architecture", "--out", "a.jpg"]) == 2
    assert "--out must end in .svg, .png or .dot, got a.jpg" in capsys.readouterr().err


def test_the_committed_picture_shows_the_imports_as_they_are(library: Architecture) -> None:
    """Else: `cgraph architecture --out docs/images/architecture.svg`."""
    shown = re.findall(r'id="(?!a_)([\w.]+)&#45;&gt;([\w.]+)"', PICTURE.read_text(encoding="utf-8"))
    assert sorted(shown) == sorted(library.arrows)
