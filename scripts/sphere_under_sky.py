#!/usr/bin/env python3
"""Writes four tables of what the classical dipole makes of a sphere under a uniform sky:

    python3 -m venv venv && venv/bin/pip install mpmath
    venv/bin/python scripts/sphere_under_sky.py 0 > experiments/verify/small_spheres.csv
    venv/bin/python scripts/sphere_under_sky.py 1 > experiments/verify/large_spheres.csv
    venv/bin/python scripts/sphere_under_sky.py 2 > experiments/figures/red_tail.csv
    venv/bin/python scripts/sphere_under_sky.py matched > experiments/verify/matched_spheres.csv

Irradiance that enters is the same at every point, pi L (1 - F_ext), F_ext = 2 int F mu dmu from outside; in chord length
d the area of a sphere is 2 pi d dd. So the radiance that leaves any point is T(mu) L (1 - F_ext) D with
D = int_0^2R R_d(d) 2 pi d dd, and the flux that leaves the sphere
    4 pi R^2 int T(mu) L (1 - F_ext) D mu dw = 4 pi^2 R^2 (1 - F_ext)^2 L D,
with R_d of Jensen, Marschner, Levoy & Hanrahan 2001 (eq. 4) and their coefficients (figure 5), A by the exact Fresnel
integral. By quadrature with 30 digits: none of it is the program's code. `matched` is the small spheres with index 1 and
no reflection: F = 0, A = 1.
"""

import sys

from mpmath import exp, mp, mpf, nstr, pi, quad, sqrt

mp.dps = 30

# Reduced scattering and absorption, 1/mm, red green blue; index; and radii, mm. With the smaller one the mean over the
# bands of the effective transport coefficient, less twice the smallest, times the diameter is below 3; with the larger
# it is above in all of them except marble, where it is negative; the third is far above.
MATERIALS = {
    "skin1": ((0.74, 0.88, 1.01), (0.032, 0.17, 0.48), 1.3, (5, 20, 40)),
    "marble": ((2.19, 2.62, 3.00), (0.0021, 0.0041, 0.0071), 1.5, (5, 20)),
    "ketchup": ((0.18, 0.07, 0.03), (0.061, 0.97, 1.45), 1.3, (1.2, 10, 20)),
    "wholemilk": ((2.55, 3.21, 3.77), (0.0011, 0.0024, 0.014), 1.3, (5, 50)),
}


def fresnel(mu, n):
    """Reflectance from outside at cosine mu."""
    inside = sqrt(1 - (1 - mu * mu) / n**2)
    s = ((mu - n * inside) / (mu + n * inside)) ** 2
    p = ((n * mu - inside) / (n * mu + inside)) ** 2
    return (s + p) / 2


def diffused(scattering, absorption, n, radius):
    scattering, absorption, n = mpf(str(scattering)), mpf(str(absorption)), mpf(str(n))
    external = quad(lambda mu: 2 * mu * fresnel(mu, n), [0, 1])
    internal = 1 - (1 - external) / n**2
    a = (1 + internal) / (1 - internal)
    extinction = scattering + absorption
    s = sqrt(3 * absorption * extinction)
    real = 1 / extinction
    virtual = real * (1 + 4 * a / 3)

    def source(z, r):
        d = sqrt(r * r + z * z)
        return z * (1 + s * d) * exp(-s * d) / d**3

    def profile(r):
        return scattering / extinction / (4 * pi) * (source(real, r) + source(virtual, r))

    ends = [0] + [x for x in (real, virtual, 4 * virtual, 20 * virtual) if x < 2 * radius] + [2 * radius]
    whole = quad(lambda r: profile(r) * 2 * pi * r, ends)
    return 4 * pi**2 * radius**2 * (1 - external) ** 2 * whole


matched = sys.argv[1] == "matched"
which = 0 if matched else int(sys.argv[1])
if matched:
    MATERIALS["skin2"] = ((1.09, 1.59, 1.79), (0.013, 0.07, 0.145), 1.3, (5,))
    MATERIALS["potato"] = ((0.68, 0.70, 0.55), (0.0024, 0.009, 0.12), 1.3, (5,))
    del MATERIALS["marble"], MATERIALS["wholemilk"]

print("# Flux that leaves a sphere under a uniform sky of radiance 1, W, after diffusing:")
print("# classical dipole (Jensen et al. 2001), exact Fresnel moments, quadrature with 30 digits.")
print("# scripts/sphere_under_sky.py writes this file and says how.")
print("label,material,radius_mm,R,G,B" if matched else "label,material,radius_mm,eta,R,G,B")
for name, (scattering, absorption, n, radii) in MATERIALS.items():
    if which >= len(radii):
        continue
    radius = radii[which]
    n = 1 if matched else n
    values = [nstr(diffused(s, a, n, mpf(str(radius))), 12) for s, a in zip(scattering, absorption)]
    index = "" if matched else f"{n},"
    print(f"{name},{name},{radius},{index}{','.join(values)}")
