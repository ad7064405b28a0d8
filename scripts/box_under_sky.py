#!/usr/bin/env python3
"""Writes what the classical dipole makes of a box under a uniform sky:

    python3 -m venv venv && venv/bin/pip install mpmath
    venv/bin/python scripts/box_under_sky.py > experiments/verify/boxes.csv

On a convex body of any shape irradiance that enters under a sky L is the same at every point, pi L (1 - F_ext), and
what leaves a point is T(mu)/pi times the exitance, so that the flux that leaves is
    pi L (1 - F_ext)^2 I,  I = int dA int dA' R_d(|x - x'|)
(scripts/sphere_under_sky.py has the case of a sphere, and the dipole). For the sides a, b, c of a box, I is a sum over
pairs of faces, each of which loses a dimension or two to the substitution u = |x - x'|, whose density on a side of length
a is 2 (a - u):
    one face with itself:  int int 4 (a - u)(b - v) R(sqrt(u^2 + v^2)) du dv
    opposite faces:        the same with R(sqrt(u^2 + v^2 + c^2))
    faces that share a:    int 2 (a - u) R(sqrt(u^2 + y^2 + z^2)) du dy dz, y from 0 to b, z from 0 to c.
By Gauss-Legendre with 40 nodes in x^2 along every side, and again with 56: both agree to the digits printed.
"""

from math import cos, exp, pi, sqrt

from mpmath import mp, quad

mp.dps = 20

MATERIALS = {
    "skin1": ((0.74, 0.88, 1.01), (0.032, 0.17, 0.48), 1.3),
    "skin2": ((1.09, 1.59, 1.79), (0.013, 0.07, 0.145), 1.3),
}
SIDES = (4.0, 6.0, 9.0)


def fresnel(mu, n):
    """Reflectance from outside at cosine mu."""
    inside = mp.sqrt(1 - (1 - mu * mu) / n**2)
    s = ((mu - n * inside) / (mu + n * inside)) ** 2
    p = ((n * mu - inside) / (n * mu + inside)) ** 2
    return (s + p) / 2


def dipole(scattering, absorption, n):
    """1 - F_ext and R_d(r)."""
    external = float(quad(lambda mu: 2 * mu * fresnel(mu, n), [0, 1]))
    internal = 1 - (1 - external) / n**2
    a = (1 + internal) / (1 - internal)
    extinction = scattering + absorption
    s = sqrt(3 * absorption * extinction)
    real = 1 / extinction
    virtual = real * (1 + 4 * a / 3)

    def source(z, r2):
        d = sqrt(r2 + z * z)
        return z * (1 + s * d) * exp(-s * d) / d**3

    def profile(r2):
        return scattering / extinction / (4 * pi) * (source(real, r2) + source(virtual, r2))

    return 1 - external, profile


def legendre(count):
    """Nodes and weights on [0, 1], by Newton's method from the usual guesses."""
    rule = []
    for i in range(count):
        x = cos(pi * (i + 0.75) / (count + 0.5))
        for _ in range(20):
            last, value = 1.0, x
            for k in range(2, count + 1):
                last, value = value, ((2 * k - 1) * x * value - (k - 1) * last) / k
            slope = count * (x * value - last) / (x * x - 1)
            x -= value / slope
        rule.append(((1 + x) / 2, 1 / ((1 - x * x) * slope**2)))
    assert abs(sum(w for _, w in rule) - 1) < 1e-13
    return rule


def nodes(rule, side):
    """For int_0^side, in x = side t^2: R varies most near 0."""
    return [(side * t * t, w * 2 * side * t) for t, w in rule]


def double(profile, rule, sides):
    total = 0.0
    for k in range(3):
        a, b, c = sides[k], sides[(k + 1) % 3], sides[(k + 2) % 3]
        along_a = [(u * u, w * 2 * (a - u)) for u, w in nodes(rule, a)]
        along_b = [(v * v, w * 2 * (b - v)) for v, w in nodes(rule, b)]
        # Two faces a x b, each with itself and with the other.
        for height in (0.0, c):
            total += 2 * sum(w * x * profile(u + v + height * height) for u, w in along_a for v, x in along_b)
        # Faces that share a side a: four such edges, in both orders.
        y_b = [(y * y, w) for y, w in nodes(rule, b)]
        z_c = [(z * z, w) for z, w in nodes(rule, c)]
        total += 8 * sum(w * x * q * profile(u + y + z) for u, w in along_a for y, x in y_b for z, q in z_c)
    return total


def main():
    a, b, c = SIDES
    print("# Flux that leaves a box of 4 x 6 x 9 mm under a uniform sky of radiance 1, W, after diffusing:")
    print("# classical dipole (Jensen et al. 2001), exact Fresnel moments, quadrature.")
    print("# scripts/box_under_sky.py writes this file and says how.")
    print("label,material,eta,R,G,B")
    rules = [legendre(40), legendre(56)]
    for name, (scattering, absorption, n) in MATERIALS.items():
        values = []
        for s, t in zip(scattering, absorption):
            entering, profile = dipole(s, t, n)
            coarse, fine = (pi * entering**2 * double(profile, rule, SIDES) for rule in rules)
            assert abs(coarse / fine - 1) < 1e-8, (name, coarse, fine)
            values.append(f"{fine:.9g}")
        print(f"{name},{name},{n},{','.join(values)}", flush=True)


main()
