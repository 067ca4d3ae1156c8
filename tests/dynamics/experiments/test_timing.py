"""Figures as text, and runs in turns."""

import time
from functools import partial

from dynamics.experiments.text_table import WIDTH, csv_text, table
from dynamics.experiments.timing import Timed, in_turns, spent


def test_runs_take_turns_on_both_clocks() -> None:
    order: list[str] = []
    runs = [Timed(partial(order.append, name), partial(order.append, "rewound")) for name in "ab"]
    in_turns(runs, 3)
    assert order == ["rewound", "a", "rewound", "b"] * 3
    assert all(len(each.seconds) == len(each.processor) == 3 and min(each.seconds) > 0.0 for each in runs)
    in_turns([short := Timed(lambda: None), long := Timed(partial(time.sleep, 0.01))], 5, chunk=1e-3, enough=0.02)
    assert len(short.seconds) > 50
    assert len(long.seconds) == 3
    assert spent(lambda: sum(range(10**6))).made == 499999500000
    assert spent(lambda: time.sleep(0.05)).seconds > 2.0 * spent(lambda: time.sleep(0.05)).processor


def test_columns_that_do_not_fit_go_below_under_the_first_one_again() -> None:
    header = ["name", *[f"{'column':>30}{k}" for k in range(5)]]
    lines = table(header, [["a", *"12345"], ["b", *[("67", "!")] * 5]])
    assert max(map(len, lines)) <= WIDTH
    assert [line.split()[0] for line in lines] == ["name", "a", "b"] * 2
    assert [line.split()[1:] for line in lines if line.startswith("b")] == [["67", "!"] * 3, ["67", "!"] * 2]
    assert table(["n", "x"], []) == ["n  x"]


def test_csv_has_empty_cells_for_what_is_not_known() -> None:
    assert csv_text(["a", "b"], [[1, None], ["x,y", 0.1]]) == 'a,b\n1,\n"x,y",0.1\n'
