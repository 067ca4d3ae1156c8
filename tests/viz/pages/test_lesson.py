"""The lesson: a page that stands alone, whose numbers are those of the mechanics."""

from __future__ import annotations

import math
import re
from html.parser import HTMLParser

import pytest

from tests.tolerances import EQUATIONS
from viz import cli
from viz.commands.lesson import ARM_DT, ARM_Q, ARM_QD, lesson
from viz.pages.lesson import page

VOID = {"meta", "br", "img", "link", "input", "hr"}


class Reader(HTMLParser):
    """Tags in order, ids, and whether every tag is closed where it should be."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[str] = []
        self.ids: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.ids += [value for name, value in attrs if name == "id"]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        self.handle_endtag(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


@pytest.fixture(scope="module")
def text() -> str:
    return page(lesson())


def test_the_page_is_well_formed_and_every_id_is_there_once(text):
    reader = Reader(text)
    assert reader.open == []
    assert len(set(reader.ids)) == len(reader.ids)
    assert reader.tags.count("svg") == 4
    assert reader.tags.count("details") == reader.tags.count("summary") == 6
    assert text.count('role="img" aria-label=') == 4


def test_the_page_stands_alone_and_runs_no_script(text):
    assert "<script" not in text
    assert not re.search(r"(src|href)=\"", text.replace("xlink:href", ""))
    assert "url(" not in text
    assert "$" not in text
    assert "prefers-color-scheme: dark" in text
    assert "focus-visible" in text


def test_the_torque_that_should_be_zero_tends_to_the_spring_s():
    for dt, torque in lesson().steps:  # I qdd - k (qdd dt^2 + 2 qd dt + q_old) at q = qd = I = k = 1, qdd = 0
        assert torque == pytest.approx(-(2.0 * dt + (1.0 - dt)), rel=EQUATIONS)


def test_the_arm_s_error_is_the_gradient_of_its_kinetic_energy(text):
    """The limit is dK/dq, here by differences of K of three rods in closed form."""
    lengths, masses = (1.0, 0.8, 0.7), (1.0, 0.8, 0.7)

    def kinetic(q: list[float]) -> float:
        total = angle = rate = vx = vy = 0.0
        for joint, speed, length, mass in zip(q, ARM_QD, lengths, masses, strict=True):
            angle, rate = angle + joint, rate + speed
            ux, uy = length * rate * math.cos(angle), length * rate * math.sin(angle)
            cx, cy = vx + ux / 2, vy + uy / 2
            total += mass * (cx * cx + cy * cy) / 2 + mass * length**2 / 12 * rate**2 / 2
            vx, vy = vx + ux, vy + uy
        return total

    slopes = []
    for i in range(3):
        high, low = ([x + sign * 1e-5 * (i == j) for j, x in enumerate(ARM_Q)] for sign in (1, -1))
        slopes.append((kinetic(high) - kinetic(low)) / 2e-5)
    found = lesson()
    assert found.arm_dt == ARM_DT
    assert found.arm_error == pytest.approx(max(map(abs, slopes)), rel=1e-4)  # first order in dt
    assert f"{found.arm_error:.2f} N m" in text


def test_the_command_writes_the_page(tmp_path, capsys, monkeypatch, text):
    monkeypatch.setattr("viz.commands.lesson.page", lambda content: text)  # drawing it again takes seconds
    assert cli.main(["lesson", "--out", str(tmp_path / "lesson.html")]) == 0
    assert (tmp_path / "lesson.html").read_text(encoding="utf-8") == text
    assert "lesson.html" in capsys.readouterr().out
