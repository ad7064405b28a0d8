"""Tests of means and ratios of efficiency, computed by the program's own code.

Functions take arrays of values, or moments as records store them, along a first axis of independent values,
and work on every column at once.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from . import _core


def _bytes(values: ArrayLike) -> bytes:
    return np.ascontiguousarray(values, dtype="<f8").tobytes()


def _every(function: Callable[..., tuple], *arrays: np.ndarray) -> tuple[np.ndarray, ...]:
    """The results of a function of triples at every place of arrays, as arrays of the same shape."""
    arrays = np.broadcast_arrays(*arrays)
    shape = arrays[0].shape
    rows = [function(*row) for row in zip(*(array.ravel() for array in arrays))]
    return tuple(np.array(column, dtype=float).reshape(shape)[()] for column in zip(*rows))


def _columns(batches: np.ndarray) -> tuple[tuple[int, ...], np.ndarray]:
    """Moments (batch, ..., 5) as columns (place, batch, 5), with the shape of the places."""
    if batches.ndim < 2 or batches.shape[-1] != len(_core.MOMENTS):
        raise ValueError(f"moments have a last axis of {len(_core.MOMENTS)}, not shape {batches.shape}")
    places = batches.shape[1:-1]
    return places, np.moveaxis(batches, 0, -2).reshape(-1, batches.shape[0], batches.shape[-1])


def _batches(values: ArrayLike, are_moments: bool) -> np.ndarray:
    """Moments by batch; single values are batches of one."""
    array = np.asarray(values, dtype=float)
    if are_moments:
        return array
    batches = np.zeros((*array.shape, len(_core.MOMENTS)))
    batches[..., 0], batches[..., 1] = 1.0, array
    return batches


def moments(values: ArrayLike) -> np.ndarray:
    """Count, mean, and the sums of second to fourth powers of deviations, of the last axis."""
    array = np.asarray(values, dtype=float)
    flat = array.reshape(-1, array.shape[-1])
    rows = [_core.moments_of(_bytes(row)) for row in flat]
    return np.array(rows).reshape(*array.shape[:-1], len(_core.MOMENTS))


@dataclass(frozen=True)
class Estimates:
    """Means with their standard errors and the errors' degrees of freedom; numbers or arrays."""

    value: np.ndarray
    std_error: np.ndarray
    dof: np.ndarray

    def interval(self, confidence: float = 0.95) -> tuple[np.ndarray, np.ndarray]:
        """Student's two-sided interval."""
        (critical,) = _every(lambda dof: (_core.student(1.0 - confidence, dof),), self.dof)
        return self.value - critical * self.std_error, self.value + critical * self.std_error


def estimate(values: ArrayLike, *, are_moments: bool = False) -> Estimates:
    """The mean over the first axis of independent values, or of batches of them (`are_moments`)."""
    places, columns = _columns(_batches(values, are_moments))
    rows = [_core.estimate(_bytes(column)) for column in columns]
    return Estimates(*(np.array(column).reshape(places)[()] for column in zip(*rows)))


@dataclass(frozen=True)
class Welch:
    """A difference of two means and the test that it is 0."""

    difference: np.ndarray
    std_error: np.ndarray
    dof: np.ndarray
    statistic: np.ndarray
    p_value: np.ndarray

    def interval(self, confidence: float = 0.95) -> tuple[np.ndarray, np.ndarray]:
        """Student's two-sided interval of the difference."""
        return Estimates(self.difference, self.std_error, self.dof).interval(confidence)


def welch(a: Estimates | ArrayLike, b: Estimates | ArrayLike) -> Welch:
    """Welch's test of a - b: values along the first axis, or estimates. Exact values have a standard error of 0."""
    a, b = (side if isinstance(side, Estimates) else estimate(side) for side in (a, b))
    sides = (a.value, a.std_error, a.dof, b.value, b.std_error, b.dof)
    return Welch(*_every(lambda *x: _core.welch(x[:3], x[3:]), *sides))


def paired(a: ArrayLike, b: ArrayLike, *, are_moments: bool = False) -> Welch:
    """The test of a - b of two sides that had the same random streams, batch by batch."""
    places, left = _columns(_batches(a, are_moments))
    others, right = _columns(_batches(b, are_moments))
    if places != others:
        raise ValueError(f"shapes {places} and {others} differ")
    rows = [_core.paired(_bytes(x), _bytes(y)) for x, y in zip(left, right)]
    return Welch(*(np.array(column).reshape(places)[()] for column in zip(*rows)))


@dataclass(frozen=True)
class Ratio:
    """Variance times cost of a baseline over a candidate's: above 1 the candidate is the better."""

    ratio: float
    interval: tuple[float, float]
    variance_ratio: float
    variance_interval: tuple[float, float]
    cost_ratio: float
    cost_interval: tuple[float, float]
    confidence: float
    resolved: bool
    """False where more passes could still change it, or where a single pass may dominate it."""
    kurtosis: tuple[float, float]
    """Of a value of the baseline and of the candidate; 3 for a normal."""


def efficiency(
    baseline: ArrayLike,
    baseline_costs: ArrayLike,
    candidate: ArrayLike,
    candidate_costs: ArrayLike,
    *,
    of_variances: bool = False,
    confidence: float = 0.95,
) -> Ratio:
    """The efficiency of a candidate over that of a baseline, with a block jackknife's interval.

    Each side is (block, value), or (block, 5) with moments where that is how a record stores them: pass
    `moments(values)` for the former. Costs are one number for each block, in a unit that both sides share.
    `of_variances`: the values are variances (`EstimatorRun.spread`) and not scores.
    """
    sides = [np.asarray(side, dtype=float) for side in (baseline, candidate)]
    for side in sides:
        if side.ndim != 2 or side.shape[1] != len(_core.MOMENTS):
            raise ValueError(f"blocks of moments have shape (block, 5), not {side.shape}; see moments()")
    ratios, resolved, kurtosis = _core.efficiency(
        _bytes(sides[0]), _bytes(baseline_costs), _bytes(sides[1]), _bytes(candidate_costs), of_variances, confidence
    )
    (work, *work_interval), (variance, *variance_interval), (cost, *cost_interval) = ratios
    return Ratio(
        ratio=work,
        interval=tuple(work_interval),
        variance_ratio=variance,
        variance_interval=tuple(variance_interval),
        cost_ratio=cost,
        cost_interval=tuple(cost_interval),
        confidence=confidence,
        resolved=resolved,
        kurtosis=tuple(kurtosis),
    )
