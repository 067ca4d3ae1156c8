"""The architecture of packages: rooms on floors, the arrows between them, and what is wrong with them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from .import_rule import PACKAGES, may_import
from .imports import Module, modules, uses

if TYPE_CHECKING:
    from cgraph.extend import Json

WHOLE = ("cgraph", "viz")  # each is one room where all packages are seen at once


@dataclass(frozen=True)
class Architecture:
    """Rooms (folders), and who imports whom.

    arrows: {(importer, imported): [(module, module) behind it, ...]} between rooms and loose modules.
    floors: {room or loose module: 1 for one that imports none of the others, else one more than the highest that it
        imports}; those of a circle share a floor.
    climbing: imports that the table of layers does not allow, module by module.
    circles, file_circles: rooms and modules that import one another, in the end.
    loose: {package: its modules beside `__init__` that are in no folder}.
    """

    rooms: tuple[str, ...]
    arrows: Mapping[tuple[str, str], Sequence[tuple[str, str]]]
    floors: Mapping[str, int]
    climbing: tuple[tuple[str, str], ...]
    circles: tuple[tuple[str, ...], ...]
    file_circles: tuple[tuple[str, ...], ...]
    loose: Mapping[str, tuple[str, ...]]

    @property
    def sound(self) -> bool:
        """No circle, and no arrow that climbs."""
        return not (self.climbing or self.circles or self.file_circles)

    def climbs(self, arrow: tuple[str, str]) -> bool:
        """Whether any import behind an arrow is one that the table does not allow."""
        return any(pair in self.climbing for pair in self.arrows[arrow])

    def implied(self, arrow: tuple[str, str]) -> bool:
        """Whether a longer way leads from the arrow's importer to what it imports."""
        importer, imported = arrow
        return any(
            imported in _reach(_heads(self.arrows), step)
            for start, step in self.arrows
            if start == importer != step != imported
        )

    def to_dict(self) -> dict[str, Json]:
        """Everything as plain data."""
        return {
            "rooms": [{"name": room, "floor": self.floors[room]} for room in self.rooms],
            "floors": max(self.floors.values(), default=0),
            "arrows": [
                {"importer": a, "imported": b, "imports": len(behind), "climbs": self.climbs((a, b))}
                for (a, b), behind in self.arrows.items()
            ],
            "climbing": [list(pair) for pair in self.climbing],
            "circles": [list(circle) for circle in self.circles],
            "file_circles": [list(circle) for circle in self.file_circles],
            "loose": {package: list(names) for package, names in self.loose.items()},
        }

    def __str__(self) -> str:
        height = max(self.floors.values(), default=0)
        lines = [
            f"{len(self.rooms)} rooms (folders) on {height} floors, {len(self.arrows)} arrows (imports between them)"
        ]
        lines += [
            f"{floor:3}  {', '.join([name for name, at in self.floors.items() if at == floor])}"
            for floor in range(height, 0, -1)
        ]
        downward = sorted(self.floors, key=lambda name: (-self.floors[name], name))
        imported = {name: [low for high, low in self.arrows if high == name] for name in downward}
        lines += [f"{name} imports {', '.join(lower)}" for name, lower in imported.items() if lower]
        lines += _listed("arrows that climb", [f"{a} imports {b}" for a, b in self.climbing])
        lines += _listed("circles of rooms", [", ".join(circle) for circle in self.circles])
        lines += _listed("circles of files", [", ".join(circle) for circle in self.file_circles])
        for package, names in self.loose.items():
            lines.append(f"loose modules in {package}: {', '.join(names) or 'none'}")
        return "\n".join(lines)


def architecture(package: str | None = None) -> Architecture:
    """The architecture of all packages, or of the folders of one. Raises ValueError for an unknown package."""
    if package is not None and package not in PACKAGES:
        raise ValueError(f"packages are {', '.join(PACKAGES)}, got {package!r}")
    return of_modules(modules(PACKAGES if package is None else [package]), PACKAGES if package is None else [package])


def of_modules(known: Mapping[str, Module], packages: Sequence[str]) -> Architecture:
    """The architecture of these modules; `cgraph` and `viz` are one room each where there are several packages."""
    used = uses(known)
    together = len(packages) > 1
    loose = {package: _loose(known, package) for package in packages}

    def room(module: str) -> str:
        top = module.partition(".")[0]
        return top if together and top in WHOLE else folder(module)

    rooms = {room(name) for name in used} - {name for names in loose.values() for name in names}
    arrows: dict[tuple[str, str], list[tuple[str, str]]] = {}
    for importer, imported in sorted((a, b) for a, targets in used.items() for b in targets):
        if room(importer) != room(imported):
            arrows.setdefault((room(importer), room(imported)), []).append((importer, imported))
    climbing = [(a, b) for a, targets in used.items() for b in targets if not may_import(folder(a), folder(b))]
    floors = _floors(sorted({room(name) for name in used}), arrows)
    return Architecture(
        tuple(sorted(rooms)),
        arrows,
        floors,
        tuple(sorted(climbing)),
        _circles(arrows),
        _circles([(a, b) for a, targets in used.items() for b in targets]),
        loose,
    )


def folder(module: str) -> str:
    """The folder of a package that a module lies in, such as "viz.pages"; a loose module is its own."""
    return ".".join(module.split(".")[:2])


def _loose(known: Mapping[str, Module], package: str) -> tuple[str, ...]:
    return tuple(name for name, at in known.items() if name.rpartition(".")[0] == package and not at.is_package)


def _listed(what: str, lines: Sequence[str]) -> list[str]:
    return [f"{what}: {len(lines) or 'none'}", *[f"  {line}" for line in lines]]


Arrows = Mapping[tuple[str, str], object] | Sequence[tuple[str, str]]


def _heads(arrows: Arrows) -> dict[str, list[str]]:
    heads: dict[str, list[str]] = {}
    for tail, head in arrows:
        heads.setdefault(tail, []).append(head)
    return heads


def _reach(heads: Mapping[str, Sequence[str]], start: str) -> set[str]:
    """All that can be reached from `start` along one arrow or more."""
    reached: set[str] = set()
    waiting = [start]
    while waiting:
        new = set(heads.get(waiting.pop(), ())) - reached
        reached |= new
        waiting += new
    return reached


def _circles(arrows: Arrows) -> tuple[tuple[str, ...], ...]:
    """Groups of those that reach one another."""
    heads = _heads(arrows)
    reach = {name: _reach(heads, name) for name in sorted(heads)}
    groups = {
        tuple(sorted(other for other in reached if name in reach.get(other, ())))
        for name, reached in reach.items()
        if name in reached
    }
    return tuple(sorted(groups))


def _floors(names: Sequence[str], arrows: Arrows) -> dict[str, int]:
    """{name: the length of the longest way down from it, plus 1}, circles counted as one."""
    circle = {name: group for group in _circles(arrows) for name in group}
    group = {name: circle.get(name, (name,)) for name in names}
    floors = dict.fromkeys(names, 1)
    for _ in names:
        for tail, head in arrows:
            if group[tail] is not group[head]:
                above = max(floors[tail], floors[head] + 1)
                floors.update(dict.fromkeys(group[tail], above))
    return floors
