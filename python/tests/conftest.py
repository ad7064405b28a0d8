"""One small experiment for all tests: a slab, two estimators, two cells, an image of 8 x 6 pixels."""

import sys
from pathlib import Path

import pytest

import scatterproof

EXPERIMENT = {
    "name": "small",
    "seed": 1,
    "bands": {"rgb": {}},
    "object": {
        "shape": {"sphere": {"radius_mm": 1.0}},
        "boundary": {"smooth": {"eta": 1.3}},
        "medium": {"coefficients": {"sigma_t_per_mm": [1, 2, 4], "albedo": 0.9, "g": 0.0}},
    },
    "sensor": {
        "perspective": {
            "resolution": [8, 6],
            "position_mm": [0, -8, 0],
            "look_at_mm": [0, 0, 0],
            "up": [0, 0, 1],
            "fov_deg": 20,
        }
    },
    "light": [{"name": "sky", "environment": {"radiance": 1.0}}],
    "estimator": [
        {"name": "weighted", "path": {}},
        {"name": "analog", "path": {"roulette": {"analog": {}}}},
    ],
    "sweep": [{"key": "object.medium.coefficients.g", "values": [0.0, 0.8]}],
    "budget": {"passes": 128},
    "claim": [{"name": "same", "agree": {"estimators": ["weighted", "analog"], "detect": 0.2}}],
}


@pytest.fixture(scope="session")
def experiment():
    return EXPERIMENT


@pytest.fixture(scope="session")
def record(tmp_path_factory):
    out = tmp_path_factory.mktemp("results")
    return scatterproof.run(EXPERIMENT, out=out, threads=2)


@pytest.fixture(scope="session")
def repository():
    root = Path(__file__).resolve().parents[2]
    assert (root / "Cargo.toml").exists(), "the tests run from the repository"
    return root


@pytest.fixture(scope="session")
def program():
    return [sys.executable, "-m", "scatterproof"]
