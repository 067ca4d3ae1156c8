"""Screen: one step of a lesson, in the form that all have; and the words that screens are made of."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

TOO_LARGE = "The graphs of this system are too large to be computed many times a second in a page."


@dataclass(frozen=True)
class Screen:
    """A story, a question with choices, what is revealed, and something to play with; texts are HTML.

    answer: the number of the right choice.  play: what the page's script draws, {"kind": .., ..}; None where a system is
    too large for it, which the screen then says.  note: for the teacher, beside the answer.
    """

    anchor: str
    title: str
    minutes: int
    story: str
    question: str
    choices: Sequence[str]
    answer: int
    reveal: str
    play_words: str
    play: Mapping[str, object] | None
    note: str
    picture: str = ""  # what the play is about

    def to_html(self, number: int) -> str:
        """The screen as a section of the page."""
        choices = "".join(
            f'<button type="button" class="choice"><b>{letter}</b> {choice}</button>'
            for letter, choice in zip("ABCDEF", self.choices, strict=False)
        )
        return (
            f'<section class="screen" id="{escape(self.anchor)}">\n'
            f"<h2>{number} · {self.title} <small>{self.minutes} minutes</small></h2>\n{self.story}\n"
            f'<div class="predict" role="group" aria-label="Predict"><p><b>Predict.</b> {self.question}</p>'
            f'<div class="choices">{choices}</div><p class="verdict" role="status"></p></div>\n'
            f'<details class="reveal"><summary>Reveal</summary>\n{self.reveal}\n</details>\n'
            f'<div class="play"><h3>Play</h3><p>{self.play_words if self.play else TOO_LARGE}</p>{self.picture}<div class="board"></div></div>\n</section>'
        )

    def answer_html(self, number: int) -> str:
        """A line of the answers for the teacher."""
        letter = "ABCDEF"[self.answer]
        return f"<li><b>{number} · {self.title}: {letter}.</b> {self.choices[self.answer]}. {self.note}</li>"


def number(value: float) -> str:
    """Four digits, with a minus that is one."""
    return f"{value:.4g}".replace("-", "−") if value else "0"


def inline(svg: str, name: str, about: str) -> str:
    """A drawing of a graph whose nodes the page's script can light up; its ids begin with the name."""
    svg = re.sub(r'\bid="', f'id="{name}-', svg)
    return f'<div class="graph-picture" role="img" aria-label="{escape(about)}">{svg}</div>'
