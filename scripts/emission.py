#!/usr/bin/env python3
"""Prints the expected columns of experiments/verify/emission.toml, what bodies that emit look like without any light:

    python3 scripts/emission.py

Python 3.8 or later, standard library only; none of it is the program's code. Radiance obeys
dL/ds = emission - sigma L along a ray that is not scattered, so over a length l it gains S (1 - a) with S = emission /
sigma and a = e^(-sigma l), and keeps a of what came in. A ray seen under the cosine mu outside runs under mu' inside
(Snell); a smooth boundary lets T = 1 - R(mu) of it out, and radiance loses eta^2.

slab, sphere    after a chord l the ray meets the boundary under the same angle, whose reflectance from inside is R again:
                  L_in = S (1 - a) (1 + R a + R^2 a^2 + ...),   L = T / eta^2 * S (1 - a) / (1 - R a)
                l = d / mu' in a slab of thickness d; l = 2 r mu' in a sphere of radius r seen at distance b from its
                middle, sin(theta) = b / r. Without extinction S (1 - a) becomes emission * l.
half-space      L_in = S in every direction, so L = S / eta^2 * E, E the part of the light that the boundary lets out:
                T where it is smooth. Through facets with normals m (Walter et al. 2007, eq. 8 to 21), t refracted,
                  E = int D(m) |o.m| / |o.n| G1(o, m) G1(t, m) (1 - F(o.m)) dm,
                o.m > 0, t.n < 0, m drawn from D (m.n) by its inverse (eq. 35, 36), by the midpoint rule.
scattering      a body in a sky of radiance B, that emits sigma_a eta^2 B and scatters, has radiance B everywhere
                (Kirchhoff): what it emits is B minus what it reflects and lets through of the sky, 1 - UR1 - UT1 of
                slab.csv (adding-doubling), for a slab seen along its normal.
"""

import csv
import math
import os

HERE = os.path.dirname(os.path.abspath(__file__))


def fresnel(mu, n):
    """Reflectance and the cosine on the other side, whose index over this one's is n."""
    squared = 1 - (1 - mu * mu) / n**2
    if squared <= 0:
        return 1.0, 0.0
    inside = math.sqrt(squared)
    s = (mu - n * inside) / (mu + n * inside)
    p = (n * mu - inside) / (n * mu + inside)
    return (s * s + p * p) / 2, inside


def chord(emission, sigma, length, eta, mu):
    """Radiance outside of rays that run through chords of one length."""
    reflectance, _ = fresnel(mu, eta)
    a = math.exp(-sigma * length)
    gained = -emission * math.expm1(-sigma * length) / sigma if sigma else emission * length
    return (1 - reflectance) / eta**2 * gained / (1 - reflectance * a)


def slab(emission, sigma, eta, mu, thickness):
    return chord(emission, sigma, thickness / fresnel(mu, eta)[1], eta, mu)


def sphere(emission, sigma, eta, offset, radius):
    mu = math.sqrt(1 - (offset / radius) ** 2)
    return chord(emission, sigma, 2 * radius * fresnel(mu, eta)[1], eta, mu)


def through_facets(alpha, eta, mu, n):
    """E of GGX facets, by n times n midpoints."""
    o = (math.sqrt(1 - mu * mu), 0.0, mu)

    def masking(cos):
        tan2 = 1 / (cos * cos) - 1
        return 2 / (1 + math.sqrt(1 + alpha**2 * tan2))

    total = 0.0
    for i in range(n):
        # u = 1 - v^2 takes the long tail of slopes evenly.
        v = (i + 0.5) / n
        u = 1 - v * v
        tan2 = alpha**2 * u / (1 - u)
        z = 1 / math.sqrt(1 + tan2)
        r = math.sqrt(tan2) * z
        for k in range(n):
            phi = math.pi * (k + 0.5) / n
            m = (r * math.cos(phi), r * math.sin(phi), z)
            om = o[0] * m[0] + o[2] * m[2]
            if om <= 0:
                continue
            reflectance, tm = fresnel(om, eta)
            # t = -o / eta + (o.m / eta - cos_t) m
            t_z = -o[2] / eta + (om / eta - tm) * m[2]
            if t_z >= 0 or tm == 0:
                continue
            weight = om / (mu * z) * masking(mu) * masking(-t_z) * (1 - reflectance)
            total += weight * 2 * v
    return total / n**2


def rows():
    """Label, band, radiance and its error."""
    absorbing = {"a": (2.0, 0.5), "b": (5.0, 3.0)}
    for band, (emission, sigma) in absorbing.items():
        yield "slab-matched", band, slab(emission, sigma, 1.0, 1.0, 0.7), 0
        yield "slab-matched-oblique", band, slab(emission, sigma, 1.0, 0.3, 0.7), 0
        yield "slab-smooth", band, slab(emission, sigma, 1.5, 1.0, 0.7), 0
        yield "slab-smooth-oblique", band, slab(emission, sigma, 1.5, 0.3, 0.7), 0
        yield "slab-clear", band, slab(emission, 0.0, 1.5, 0.3, 0.7), 0
        yield "sphere-matched", band, sphere(emission, sigma, 1.0, 0.9, 1.0), 0
        yield "sphere-smooth", band, sphere(emission, sigma, 1.5, 0.3, 1.0), 0
        yield "sphere-smooth-rim", band, sphere(emission, sigma, 1.5, 0.9, 1.0), 0
        yield "sphere-thin", band, sphere(emission, sigma, 0.8, 0.5, 1.0), 0
        yield "half-space-smooth", band, emission / sigma / 1.5**2 * (1 - fresnel(0.3, 1.5)[0]), 0
        for label, mu in (("half-space-rough", 1.0), ("half-space-rough-oblique", 0.3)):
            coarse, fine = (through_facets(0.4, 1.5, mu, n) for n in (400, 800))
            yield label, band, emission / sigma / 1.5**2 * fine, emission / sigma / 1.5**2 * abs(fine - coarse)
    table = os.path.join(HERE, "..", "experiments", "verify", "slab.csv")
    with open(table) as file:
        known = list(csv.DictReader(line for line in file if not line.startswith("#")))
    for label, g, n, thickness, albedos in SCATTERING:
        for band, albedo in zip("ab", albedos):
            key = [float(x) for x in (albedo, thickness, g, n)]
            [row] = [r for r in known if r["b"] != "inf" and [float(r[k]) for k in ("albedo", "b", "g", "n")] == key]
            error = 2 * float(row["err_est"])
            yield label, band, 1 - float(row["UR1"]) - float(row["UT1"]), error


# Labels, g, index, optical thickness and the albedos of the two bands, as slab.csv has them.
SCATTERING = [
    ("scattering-isotropic", 0.0, 1.3, 1.0, (0.8, 0.95)),
    ("scattering-matched", 0.5, 1.0, 2.0, (0.5, 0.9)),
    ("scattering-forward", 0.9, 1.4, 1.0, (0.9, 0.99)),
]

if __name__ == "__main__":
    table = {}
    for label, band, value, error in rows():
        table.setdefault(label, {})[band] = (value, error)
    for label, bands in table.items():
        columns = [f"{band} = {value:.15g}, {band}_error = {error:.1g}" for band, (value, error) in bands.items()]
        print(f"{label}: columns = {{ {', '.join(columns)} }}")
