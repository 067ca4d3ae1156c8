"""Tolerances that many tests share: how far rounding may take two right answers apart, and why."""

LAST_BITS = 1e-15  # a rounding or two
SHORT_SUM = 1e-14  # some ten roundings, nothing cancels
LONG_SUM = 1e-13  # some hundred roundings
EQUATIONS = 1e-12  # equations of motion of some ten bodies: thousands of roundings, and a digit of cancellation
TORQUES = 1e-11  # torques by two models that differ in their structure
SOLVED = 1e-10  # besides, a solve with a mass matrix of a condition up to 1e4
SUMS = 1e-9  # sums over very many paths or roundings, up to a million
CONDITIONED = 1e-8  # the square root of rounding: an inverse of condition 1e8, or a difference of finite steps
