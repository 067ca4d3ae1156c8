"""Roots, hyperbolic, inverse and error functions for WebAssembly, and choices, as texts for `translate`."""

from __future__ import annotations

from .elementary_functions import polynomial

# fdlibm (s_atan.c; Sun Microsystems, 1993)
_ATAN: tuple[float, ...] = (3.33333333333329318027e-01, -1.99999999998764832476e-01, 1.42857142725034663711e-01)
_ATAN += (-1.11111104054623557880e-01, 9.09088713343650656196e-02, -7.69187620504482999495e-02)
_ATAN += (6.66107313738753120669e-02, -5.83357013379057348645e-02, 4.97687799461593236017e-02)
_ATAN += (-3.65315727442169155270e-02, 1.62858201153657823623e-02)

TEXT = f"""
def cbrt(x):
    a = abs(x)
    if (x - x != 0.0) | (x == 0.0):
        return x
    if a < {2.0**-500!r}:
        return cbrt(x * {2.0**600!r}) * {2.0**-200!r}
    if a > {2.0**1000!r}:
        return cbrt(x * {2.0**-600!r}) * {2.0**200!r}
    y = double(bits(a) // 3 + {715094163 << 32})
    k = 4.0
    while k > 0.0:
        y = y - (y - a / (y * y)) / 3.0
        k = k - 1.0
    p, b = product(y, y)
    q, c = product(p, y)
    return copysign(y - (q - a + (c + b * y)) / (3.0 * p), x)

def hypot(a, b):
    x = max(abs(a), abs(b))
    y = min(abs(a), abs(b))
    if (abs(a) == 1e999) | (abs(b) == 1e999):
        return 1e999
    if y <= x * {2.0**-60!r}:
        return x + y
    if x > {2.0**510!r}:
        return hypot(x * {2.0**-600!r}, y * {2.0**-600!r}) * {2.0**600!r}
    if x < {2.0**-420!r}:
        return hypot(x * {2.0**600!r}, y * {2.0**600!r}) * {2.0**-600!r}
    p, a = product(x, x)
    q, b = product(y, y)
    h, c = quickly(p, q)
    r = sqrt(h)
    p, q = product(r, r)
    return r + (h - p - q + (c + a + b)) / (2.0 * r)

def logistic(x):
    e = exp(-abs(x))
    return (e if x < 0.0 else 1.0) / (1.0 + e)

def sinh(x):
    a = abs(x)
    if a < 22.0:
        t = expm1(a)
        a = 0.5 * (t + t / (t + 1.0))
    else:
        a = exponential(a, 0.0, -1)
    return copysign(a, x)

def cosh(x):
    a = abs(x)
    if a < 22.0:
        e = exp(a)
        return 0.5 * e + 0.5 / e
    return exponential(a, 0.0, -1)

def tanh(x):
    t = expm1(-2.0 * abs(x))
    return copysign(t / (t + 2.0), x)

def atan(x):
    t = abs(x)
    high = 0.0
    low = 0.0
    if t >= 2.4375:
        t = -1.0 / t
        high = 1.5707963267948966
        low = 6.123233995736766e-17
    elif t >= 1.1875:
        t = (t - 1.5) / (1.0 + 1.5 * t)
        high = 0.982793723247329
        low = 1.3903311031230998e-17
    elif t >= 0.6875:
        t = (t - 1.0) / (t + 1.0)
        high = 0.7853981633974483
        low = 3.061616997868383e-17
    elif t >= 0.4375:
        t = (2.0 * t - 1.0) / (2.0 + t)
        high = 0.4636476090008061
        low = 2.2698777452961687e-17
    z = t * t
    return copysign(high - (t * z * {polynomial("z", _ATAN)} - low - t), x)

def atan2(y, x):
    a = abs(y)
    b = abs(x)
    r = 1.0 if a == b else a / b
    r = atan(0.0 if (a == 0.0) & (b == 0.0) else r)
    return copysign(3.141592653589793 - (r - 1.2246467991473532e-16) if bits(x) < 0 else r, y)

def asin(x):
    return atan(x / sqrt((1.0 - x) * (1.0 + x)))

def acos(x):
    return 2.0 * atan(sqrt((1.0 - x) / (1.0 + x)))

def erf(x):
    if abs(x) < 1.0:
        return by_series(x)
    return copysign(1.0 - by_fraction(abs(x)), x)

def erfc(x):
    if abs(x) < 1.0:
        return 1.0 - by_series(x)
    if x < 0.0:
        return 2.0 - by_fraction(-x)
    return by_fraction(x)

def by_series(x):  # erf x = 2 / sqrt(pi) (x - x**3 / (1! 3) + x**5 / (2! 5) - ...), the last terms first
    y = 0.0
    k = 20.0
    while k >= 0.0:
        y = 1.0 / (2.0 * k + 1.0) - x * x / (k + 1.0) * y
        k = k - 1.0
    return 1.1283791670955126 * x * y

def by_fraction(x):  # erfc x = exp(-x**2) / sqrt(pi) / (x + 1/2 / (x + 1 / (x + 3/2 / (x + ...))))
    h = double(bits(x) & -134217728)
    b = x
    k = 100.0
    while k > 0.0:
        b = x + k / b
        k = k - 0.5
    return 0.0 if x >= 28.0 else exp(-h * h) * exp((h - x) * (h + x)) / (1.772453850905516 * b)

def fmod(a, b):
    r = abs(a)
    d = abs(b)
    if (r < 1e999) & (d > 0.0):
        t = d
        while r - t >= t:
            t = t + t
        while (t >= d) & (r >= d):
            r = r - t if r >= t else r
            t = 0.5 * t
        return copysign(r, a)
    return a * b / (a * b)

def sign(x):
    return x if x != x else float(x > 0.0) - float(x < 0.0)

def minimum(a, b):
    return a if (a <= b) | (a != a) else b

def maximum(a, b):
    return a if (a >= b) | (a != a) else b
"""
