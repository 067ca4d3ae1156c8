"""Screen of a lesson: a story, a question with a measured answer, what is revealed, and something to play with."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape

import numpy as np

from ..graph_drawing.legend import to_adaptive
from ..pages.document import Picture

LETTERS = "ABCDEF"
TOO_LARGE = "The graphs of this system are too large to be computed many times a second in a page."


@dataclass(frozen=True)
class Figure:
    """A drawing of a graph to be marked, as SVG.

    task: what to mark, on paper.  answer: the sentence on the marks.
    """

    plain: str
    marked: str
    caption: str
    task: str
    answer: str

    def html(self, *, marked: bool = False, paper: bool = False) -> str:
        """The picture with its caption, which follows the reader's colors except on paper."""
        svg = self.marked if marked else self.plain
        caption = self.answer if marked else self.caption
        return Picture("", svg if paper else to_adaptive(svg), caption, None).html()


@dataclass(frozen=True)
class Screen:
    """A story, a question with choices, what is revealed, and something to play with; texts are HTML.

    answer: the number of the choice that was measured.  figure: shown in the story, with its marks in what is revealed.
    play: what the page's script draws, {"kind": .., ..}; None where a system is too large for it, which the screen then
    says.  play_words: empty where there is nothing to play with.  note: for the teacher, beside the answer.
    """

    anchor: str
    title: str
    minutes: int
    story: str
    question: str
    choices: Sequence[str]
    answer: int
    reveal: str
    note: str
    play_words: str = ""
    play: Mapping[str, object] | None = None
    picture: str = ""  # what the play is about
    figure: Figure | None = None

    def arranged(self, seed: str) -> Screen:
        """The screen with its choices in an order that only the seed knows; those that are numbers by size."""
        numbers = [re.match(r"[−-]?\d+(\.\d+)?(e[−-]?\d+)?", choice) for choice in self.choices]
        if numbers.count(None) <= 1:
            values = [math.inf if each is None else float(each[0].replace("−", "-")) for each in numbers]
            order = sorted(range(len(values)), key=values.__getitem__)
        else:
            order = np.random.default_rng([*f"{seed} {self.anchor}".encode()]).permutation(len(numbers)).tolist()
        return replace(self, choices=[self.choices[k] for k in order], answer=order.index(self.answer))

    def to_html(self, number: int) -> str:
        """The screen as a section of the page."""
        choices = "".join(
            [f'<button type="button" class="choice"><b>{letter}</b> {text}</button>' for letter, text in self._lettered]
        )
        shown, marked = (self.figure.html(), self.figure.html(marked=True)) if self.figure else ("", "")
        words = self.play_words if self.play else TOO_LARGE
        board = '<div class="board"></div>'
        if self.picture:
            board = f'<div class="walk">{self.picture}{board}</div>'
        play = f'<div class="play"><h3>Try it</h3><p>{words}</p>{board}</div>\n'
        return (
            f'<section class="screen" id="{escape(self.anchor)}">\n{self._heading(number)}\n{self.story}\n{shown}\n'
            f'<div class="predict" role="group" aria-label="Predict"><p><b>Predict.</b> {self.question}</p>'
            f'<div class="choices">{choices}</div><p class="verdict" role="status"></p></div>\n'
            f'<details class="reveal"><summary>Reveal</summary>\n{self._answer}\n{self.reveal}\n{marked}\n</details>\n'
            f"{play if self.play_words else ''}</section>"
        )

    def paper_html(self, number: int, *, key: bool) -> str:
        """The screen on a worksheet, or on its key."""
        choices = "".join([f"<li><b>{letter}</b> <span></span> {text}</li>" for letter, text in self._lettered])
        figure = self.figure.html(marked=key, paper=True) if self.figure else ""
        task = f'<p class="task"><b>Mark.</b> {self.figure.task}</p>' if self.figure and not key else ""
        reveal = self.reveal.replace("<details>", "<details open>")
        told = f'<div class="key">{self._answer}\n{reveal}<p><b>For the teacher.</b> {self.note}</p></div>'
        lines = '<p class="because">Because</p><p class="line"></p><p class="line"></p>'
        return (
            f'<section id="{escape(self.anchor)}">\n{self._heading(number)}\n{"" if key else self.story}\n{task}{figure}\n'
            f'<div class="question"><p>{self.question}</p><ul class="choices">{choices}</ul>'
            f"{told if key else lines}</div>\n</section>"
        )

    @property
    def _lettered(self) -> list[tuple[str, str]]:
        return [*zip(LETTERS, self.choices, strict=False)]

    @property
    def _answer(self) -> str:
        """The right choice, with its letter: what every answer begins with."""
        return f'<p class="answer"><b>{LETTERS[self.answer]}.</b> {self.choices[self.answer]}.</p>'

    def _heading(self, number: int) -> str:
        return f"<h2>{number} · {self.title} <small>{self.minutes} minutes</small></h2>"
