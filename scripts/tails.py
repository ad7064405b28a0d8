#!/usr/bin/env python3
"""Writes tests/data/tails.csv: tail probabilities to 20 digits, computed with 60 digits.

    python3 -m venv venv && venv/bin/pip install mpmath scipy
    venv/bin/python scripts/tails.py > tests/data/tails.csv

scipy only proposes where to look (a statistic near a wanted probability, rounded to a short number);
every probability is computed here, by formulas and an arithmetic that the program does not use:
quadrature of densities (Student), Legendre's continued fraction or the power series of the incomplete
gamma function (chi-square), sums of exact terms (binomial, Smirnov, Poisson mixture).
mpmath's own betainc and gammainc check some of them. Takes about five minutes.
"""

import sys

from mpmath import (betainc, erfc, exp, gammainc, inf, log, loggamma, mp, mpf, nstr, pi, quad,
                    sqrt)
from scipy import stats

mp.dps = 60
WANTED = [0.999, 0.9, 0.5, 0.1, 1e-2, 1e-4, 1e-6, 1e-9, 1e-12, 1e-20, 1e-50, 1e-100, 1e-200, 1e-300]


def short(x):
    """A nearby number of nine digits: the table holds it exactly, and so does a double."""
    return float("%.9g" % x)


def normal_two(z):
    return erfc(mpf(z) / sqrt(2))


def gamma_q(a, x):
    """Regularised upper incomplete gamma function."""
    front = exp(a * log(x) - x - loggamma(a))
    if x < a + 1:
        term, total, k = 1 / a, 1 / a, a
        while term > total * mpf(10) ** -55:
            k += 1
            term *= x / k
            total += term
        return 1 - front * total
    # Legendre's fraction by Lentz's method.
    b, c = x + 1 - a, mpf(10) ** 100
    d = 1 / b
    h, i = d, 0
    while True:
        i += 1
        an = -i * (i - a)
        b += 2
        d = 1 / (an * d + b)
        c = b + an / c
        h *= d * c
        if abs(d * c - 1) < mpf(10) ** -55:
            return front * h


def chi_square(x, dof):
    return gamma_q(mpf(dof) / 2, mpf(x) / 2)


def student_two(t, dof):
    t, n = mpf(t), mpf(dof)
    front = 2 * exp(loggamma((n + 1) / 2) - loggamma(n / 2)) / sqrt(n * pi)
    if t * t > n:  # a power's tail: in v = t/s, from 0 to 1
        tail = quad(lambda v: v ** (n - 1) * (v * v / (t * t) + 1 / n) ** (-(n + 1) / 2), [0, 0.5, 0.9, 1])
        return front * tail * t ** -n
    # s = t + w v, with w the length over which the density falls by e.
    w = 1 / max(mpf(1), (n + 1) * t / (n + t * t))
    points = [0, 1, 2, 4, 8, 16, 32, 64, 128, 256, 1024, 4096, 2 ** 16, 2 ** 20, 2 ** 30, inf]
    density = lambda s: exp(-(n + 1) / 2 * log(1 + s * s / n))
    return front * w * quad(lambda v: density(t + w * v), points)


def binomial_upper(k, n, p):
    """P(X >= k), by the pmf at k and the ratios of the terms after it."""
    if k == 0:
        return mpf(1)
    if k > n:
        return mpf(0)
    p = mpf(p)
    q = 1 - p
    if k <= n * p:
        return 1 - binomial_upper_small(n - k + 1, n, q)
    return binomial_upper_small(k, n, p)


def binomial_upper_small(k, n, p):
    q = 1 - p
    first = loggamma(mpf(n) + 1) - loggamma(mpf(k) + 1) - loggamma(mpf(n - k) + 1)
    first = exp(first + k * log(p) + (n - k) * log(q))
    term = total = mpf(1)
    odds = p / q
    for j in range(k, n):
        term *= odds * (n - j) / (j + 1)
        total += term
        if term < total * mpf(10) ** -45:
            break
    return first * total


def kolmogorov(x):
    x = mpf(x)
    if x < 1:
        return 1 - sqrt(2 * pi) / x * sum(exp(-((2 * k - 1) * pi / x) ** 2 / 8) for k in range(1, 30))
    return 2 * sum((-1) ** (k - 1) * exp(-2 * (k * x) ** 2) for k in range(1, 30))


def smirnov(d, n):
    """P(D+ >= d), Birnbaum and Tingey (1951)."""
    d = mpf(d)
    total, choose = mpf(0), mpf(1)
    for j in range(0, int(n * (1 - d)) + 1):
        if j > 0:
            choose = choose * (n - j + 1) / j
        total += choose * (d + mpf(j) / n) ** (j - 1) * (1 - d - mpf(j) / n) ** (n - j)
    return d * total


def noncentral(x, dof, shift):
    """Poisson mixture of chi-squares with dof + 2 j degrees of freedom."""
    y, m = mpf(x) / 2, mpf(shift) / 2
    j = max(0, int(m - 16 * sqrt(m) - 60))
    a = mpf(dof) / 2 + j
    q = gamma_q(a, y)
    term = exp(a * log(y) - y - loggamma(a + 1))
    weight = exp(j * log(m) - m - loggamma(mpf(j) + 1))
    total = mpf(0)
    while True:
        total += weight * q
        q += term
        a += 1
        term *= y / a
        j += 1
        weight *= m / j
        if j > m and weight / (1 - m / (j + 1)) < total * mpf(10) ** -40:
            return total


def row(name, a, b, statistic, p):
    if 0 < p and p > mpf(10) ** -305:
        print(",".join([name, repr(a), repr(b), repr(statistic), nstr(p, 20, min_fixed=0, max_fixed=0)]))
        sys.stdout.flush()


def check(a, b):
    assert abs(a / b - 1) < mpf(10) ** -25, (nstr(a, 30), nstr(b, 30))


check(student_two(2.5, 5), betainc(mpf(5) / 2, mpf(1) / 2, 0, 5 / (5 + mpf(2.5) ** 2), regularized=True))
check(student_two(20, 63), betainc(mpf(63) / 2, mpf(1) / 2, 0, mpf(63) / (63 + 400), regularized=True))
check(student_two(1e15, 7), betainc(mpf(7) / 2, mpf(1) / 2, 0, 7 / (7 + mpf(10) ** 30), regularized=True))
check(student_two(20000, 63), betainc(mpf(63) / 2, mpf(1) / 2, 0, 63 / (63 + mpf(4) * 10 ** 8), regularized=True))
check(student_two(7, 1), betainc(mpf(1) / 2, mpf(1) / 2, 0, mpf(1) / 50, regularized=True))
check(chi_square(90, 63), gammainc(mpf(63) / 2, 45, inf, regularized=True))
check(chi_square(50, 63), gammainc(mpf(63) / 2, 25, inf, regularized=True))
check(binomial_upper(30, 50, 0.5), betainc(30, 21, 0, mpf(0.5), regularized=True))
check(binomial_upper(20, 50, 0.5), betainc(20, 31, 0, mpf(0.5), regularized=True))
# n = 2, by hand: D+ >= 3/4 is that both points lie below 1/4 (their step to 1 is at the larger).
check(smirnov(0.75, 2), mpf(1) / 16)

print("distribution,a,b,statistic,p")
for p in WANTED:
    z = short(stats.norm.isf(p / 2))
    row("normal_two_sided", 0.0, 0.0, z, normal_two(z))
    z = short(stats.norm.isf(p))
    row("normal_upper", 0.0, 0.0, z, erfc(mpf(z) / sqrt(2)) / 2)
for dof in [1, 2, 3, 4.5, 7, 15, 31, 63, 126.3, 255, 1023, 10000, 100000, 1000000]:
    for p in WANTED:
        t = short(stats.t.isf(p / 2, dof))
        if not 0 < t < 1e100:
            continue  # scipy proposes none
        row("student_two_sided", float(dof), 0.0, t, student_two(t, dof))
    for p in [0.9, 1e-3, 1e-12]:
        t = short(stats.t.isf(p, dof))
        two = student_two(abs(t), dof)
        row("student_upper", float(dof), 0.0, t, two / 2 if t > 0 else 1 - two / 2)
for dof in [1, 2, 3, 7, 15, 63, 255, 1023, 12799, 100000, 1000000]:
    for p in WANTED:
        x = short(stats.chi2.isf(p, dof))
        row("chi_square", float(dof), 0.0, x, chi_square(x, dof))
for n in [1, 10, 100, 1000, 10000, 1000000, 100000000]:
    for prob in [1e-7, 0.001, 0.04, 0.3, 0.5, 0.9, 0.9999]:
        seen = set()
        for p in WANTED:
            k = int(stats.binom.isf(p, n, prob)) if p > 1e-12 else int(
                n * prob + stats.norm.isf(p) * (n * prob * (1 - prob)) ** 0.5)
            for name, k in [("binomial_upper", k), ("binomial_lower", 2 * round(n * prob) - k)]:
                if not 0 <= k <= n or (name, k) in seen:
                    continue
                seen.add((name, k))
                if name == "binomial_upper":
                    row(name, float(n), prob, float(k), binomial_upper(k, n, prob))
                else:  # P(X <= k) = P(n - X >= n - k)
                    p, q = mpf(prob), 1 - mpf(prob)
                    upper = binomial_upper(k + 1, n, prob) if k < n * p else None
                    tail = binomial_upper_small(n - k, n, q) if k < n * p else 1 - binomial_upper(k + 1, n, prob)
                    if upper is not None and tail > mpf(10) ** -20:
                        check(tail, 1 - upper)
                    row(name, float(n), prob, float(k), tail)
for p in WANTED:
    x = short(stats.kstwobign.isf(p)) if p > 1e-14 else short((-log(mpf(p) / 2) / 2) ** 0.5)
    row("kolmogorov_limit", 0.0, 0.0, x, kolmogorov(x))
for n in [10, 100, 1000, 10000]:
    for p in WANTED:
        d = short((-log(mpf(p)) / 2 / n) ** 0.5)
        if 0 < d < 0.95:
            row("smirnov", float(n), 0.0, d, smirnov(d, n))
for dof in [1, 2, 15, 63, 255, 1023, 1000000]:
    for shift in [0.01, 1, 39, 306, 66500, 1000000]:
        for p in WANTED:
            mean, sd = dof + shift, (2 * (dof + 2 * shift)) ** 0.5
            x = stats.ncx2.isf(p, dof, shift) if p >= 1e-6 else mean + sd * stats.norm.isf(p)
            if p < 1e-200 or not x > 0 or x != x:
                continue
            row("noncentral_chi_square", float(dof), float(shift), short(x), noncentral(short(x), dof, shift))
