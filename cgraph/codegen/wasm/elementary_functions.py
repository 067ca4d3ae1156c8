"""Sine, cosine, exponentials, logarithms and powers for WebAssembly, as texts for `translate`.

Their reductions and polynomials follow fdlibm (Sun Microsystems, 1993). Sine and cosine of large arguments, and
of those near a zero, multiply by the digits of 2/pi at TABLE.
"""

from __future__ import annotations

from collections.abc import Sequence

from ..vector_math import COS, HALF_PI, LN2, SIN

DIGITS = 1160  # of 2/pi in bits: what the largest double needs
ROOM = DIGITS // 8 + 11  # bytes of the table: above the first digit it reads zeros
_REST = 6.07710050650619224932e-11  # of pi / 2, after its first 33 bits
_EXP: tuple[float, ...] = (1.66666666666666019037e-01, -2.77777777770155933842e-03, 6.61375632143793436117e-05)
_EXP += (-1.65339022054652515390e-06, 4.13813679705723846039e-08)


def polynomial(x: str, coefficients: Sequence[float]) -> str:
    """c0 + c1 x + c2 x**2 + ..., by Horner's scheme."""
    text = repr(coefficients[-1])
    for each in coefficients[-2::-1]:
        text = f"({each!r} + {x} * {text})"
    return text


TEXT = f"""
def sin(x):
    return wave(x, 0)

def cos(x):
    return wave(x, 1)

def tan(x):
    return wave(x, 0) / wave(x, 1)

def wave(x, shift: i64):  # sin(x + shift pi/2): x = k pi/2 + a - b
    first = {HALF_PI[0]!r}
    second = {_REST!r}
    k = round(x * 0.6366197723675814) + 0.0
    n = int(k)
    a = x - k * first
    b = k * second
    if abs(a - b) < abs(k) * {2.0**-20!r}:  # too much is cancelled, or x is large: x 2/pi digit by digit
        e = bits(x) >> 52 & 2047
        p = {DIGITS + 891} - e
        e = int(x * double(2098 - e << 52))
        end = p + 192
        c = 0
        n = 0
        high = 0.0
        low = 0.0
        while p < end:
            k = float(n)
            a = high + k
            low = (low + (high - (a - k))) * 0.00390625
            high = a * 0.00390625
            c = c + e * (word(address(p >> 3), TABLE) >> (p & 7) & 255)
            n = c << 56 >> 56
            c = c - n >> 8
            p = p + 8
        k = double(bits(high) & -8589934592)
        a = k * first
        b = -(k * second + (high - k + low) * (first + second))
    r = a - b
    low = a - r - b
    z = r * r
    n = n + shift
    if n & 1:
        h = 0.5 * z
        a = 1.0 - h
        a = a + (1.0 - a - h + (z * z * {polynomial("z", COS)} - r * low))
    else:
        h = z * r
        a = r - (z * (0.5 * low - h * {polynomial("z", SIN[1:])}) - low - h * {SIN[0]!r})
    return -a if n & 2 else a

def product(a, b) -> pair:
    p = a * b
    c = double(bits(a) & -134217728)
    d = double(bits(b) & -134217728)
    return p, c * d - p + c * (b - d) + (a - c) * d + (a - c) * (b - d)

def quickly(a, b) -> pair:  # a + b, where a is the larger or 0
    s = a + b
    return s, b - (s - a)

def scaled(x, k: i64):  # x 2**k, rounded once
    return x * double(1023 + (k >> 1) << 52) * double(1023 + (k - (k >> 1)) << 52)

def growth(a, b):  # exp(a - b) - 1, for |a| below 0.35 and a small b
    r = a - b
    z = r * r
    c = r - z * {polynomial("z", _EXP)}
    return r * c / (2.0 - c) - b + a

def exponential(x, low, k: i64):  # exp(x + low) 2**k
    x = min(max(x, -800.0), 800.0)
    n = round(x * 1.4426950408889634)
    return scaled(1.0 + growth(x - n * {LN2[0]!r}, n * {LN2[1]!r} - low), int(n) + k)

def exp(x):
    return exponential(x, 0.0, 0)

def exp2(x):
    x = min(max(x, -1100.0), 1100.0)
    n = round(x)
    a, b = product(x - n, 0.6931471805599453)
    return scaled(1.0 + growth(a, -b - (x - n) * 2.3190468138462996e-17), int(n))

def expm1(x):
    if x == 0.0:
        return x
    c = min(max(x, -60.0), 800.0)
    n = round(c * 1.4426950408889634)
    g = growth(c - n * {LN2[0]!r}, n * {LN2[1]!r})
    return scaled(1.0 - scaled(1.0, 0 - int(n)) + g, int(n))

def logarithm(x) -> pair:  # log x, to 2**-64 of itself: log 2**n and 2 artanh s, in pairs of doubles
    if (x > 0.0) & (x < 1e999):
        tiny = x < {2.0**-1022!r}
        x = x * {2.0**54!r} if tiny else x
        n = bits(x) - {0x3FE6A09E667F3BCD} >> 52
        f = double(bits(x) - (n << 52)) - 1.0
        d = 2.0 + f
        s = f / d
        a, b = product(s, d)
        low = (f - a - b - s * (f - (d - 2.0))) / d
        z, b = product(s, s)
        t, a = product(z, 0.6666666666666666)
        a = a + ((b + 2.0 * s * low) * 0.6666666666666666 + z * 3.700743415417188e-17)
        c, b = product(s, t)
        b = b + (s * a + low * t)
        t = 0.0
        d = 27.0
        while d > 4.0:
            t = 2.0 / d + z * t
            d = d - 2.0
        b = b + s * z * z * t
        n = n - 54 if tiny else n
        h, a = quickly(float(n) * {LN2[0]!r}, 2.0 * s)
        h, c = quickly(h, c)
        h, low = quickly(h, a + c + (2.0 * low + b) + float(n) * {LN2[1]!r})
        return h, low
    return sqrt(x) if x != 0.0 else -1e999, 0.0

def log(x):
    h, low = logarithm(x)
    return h + low

def log1p(x):
    u = 1.0 + x
    if u == 1.0:
        return x
    h, low = logarithm(u)
    if (u > 0.0) & (u < 1e999):
        low = low + (x - (u - 1.0) if x < 1.0 else 1.0 - (u - x)) / u
    return h + low

def log2(x):
    return logarithm_by(x, 1.4426950408889634, 2.0355273740931033e-17)

def log10(x):
    return logarithm_by(x, 0.4342944819032518, 1.098319650216765e-17)

def logarithm_by(x, c, d):
    h, low = logarithm(x)
    a, b = product(h, c)
    return a + (b + (h * d + low * c)) if abs(h) < 1e999 else h

def pow(a, b):
    if (a == 1.0) | (b == 0.0):
        return 1.0
    h, low = logarithm(abs(a))
    p, e = product(h, b)
    y = exponential(p, e + low * b if abs(p) < 800.0 else 0.0, 0)
    y = y if abs(a) != 1.0 else 1.0 if b == b else b
    if bits(a) < 0:
        if floor(b) != b:
            return y if (a == 0.0) | (a - a != 0.0) else sqrt(-1.0)
        return -y if 2.0 * floor(0.5 * b) != b else y
    return y
"""
