"""The functions against numpy, against numbers of scipy, and against the program's own tables."""

import numpy as np
import pytest

import scatterproof as sp

A = np.array([1.0, 2.5, 3.25, 0.5, 9.0, 4.0, 4.5])
B = np.array([2.0, 2.25, 7.5, 1.5, 9.5, 8.0, 3.0])


def test_welch_is_scipys():
    # scipy.stats.ttest_ind(A, B, equal_var=False), ttest_rel(A, B), ttest_1samp(A, 3.0)
    test = sp.welch(A, B)
    np.testing.assert_allclose(test.statistic, -0.7739996775002014, rtol=1e-13)
    np.testing.assert_allclose(test.p_value, 0.45436054217716465, rtol=1e-12)
    np.testing.assert_allclose(test.dof, 11.643267924725107, rtol=1e-13)
    test = sp.paired(A, B)
    np.testing.assert_allclose(test.statistic, -1.6019789741639454, rtol=1e-13)
    np.testing.assert_allclose(test.p_value, 0.1602798298021094, rtol=1e-12)
    exact = sp.Estimates(np.array(3.0), np.array(0.0), np.array(np.inf))
    np.testing.assert_allclose(sp.welch(A, exact).p_value, 0.6334586414588788, rtol=1e-12)
    # scipy.stats.t.interval(0.95, 6, A.mean(), A.std(ddof=1) / 7**0.5)
    low, high = sp.estimate(A).interval()
    half = 2.446911851144969 * A.std(ddof=1) / np.sqrt(7)
    np.testing.assert_allclose([low, high], [A.mean() - half, A.mean() + half], rtol=1e-10)


def test_columns_are_tested_by_themselves():
    stacked = sp.welch(np.stack([A, B], axis=1), np.stack([B, A], axis=1))
    assert stacked.difference.shape == (2,)
    assert stacked.p_value[0] == sp.welch(A, B).p_value
    assert stacked.difference[1] == -stacked.difference[0]


def test_moments_are_numpys():
    values = np.random.default_rng(1).lognormal(size=(3, 50))
    n, mean, m2, m3, m4 = np.moveaxis(sp.moments(values), -1, 0)
    assert np.all(n == 50)
    np.testing.assert_allclose(mean, values.mean(axis=1), rtol=1e-13)
    deviation = values - values.mean(axis=1, keepdims=True)
    for found, power in (m2, 2), (m3, 3), (m4, 4):
        np.testing.assert_allclose(found, (deviation**power).sum(axis=1), rtol=1e-11)


def test_efficiency_of_known_variances_and_costs():
    draws = np.random.default_rng(2)
    a = sp.moments(draws.normal(scale=2.0, size=(64, 100)))
    b = sp.moments(draws.normal(scale=1.0, size=(64, 100)))
    # 4 times the variance at half the cost: a ratio of 2.
    ratio = sp.efficiency(a, np.full(64, 50.0), b, np.full(64, 100.0))
    assert ratio.interval[0] < 2.0 < ratio.interval[1]
    assert ratio.interval[1] / ratio.interval[0] < 1.2
    np.testing.assert_allclose(ratio.cost_ratio, 0.5, rtol=1e-12)
    np.testing.assert_allclose(ratio.ratio, ratio.variance_ratio * ratio.cost_ratio, rtol=1e-12)
    assert ratio.resolved
    swapped = sp.efficiency(b, np.full(64, 100.0), a, np.full(64, 50.0))
    np.testing.assert_allclose(swapped.ratio * ratio.ratio, 1.0, rtol=1e-12)


def test_efficiency_is_that_of_the_programs_table(record):
    rows = record.comparisons()
    rows = rows[(rows["metric"] == "mean") & (rows["class"] == "all") & (rows["cost"] == "counters")]
    assert len(rows) == 6
    for row in rows.itertuples():
        sides = [record.run(name, row.cell) for name in (row.baseline, row.candidate)]
        batches = [np.asarray(run.moments.sel(observable="mean", band=row.band)) for run in sides]
        costs = [batch[:, 0].copy() for batch in batches]
        ratio = sp.efficiency(batches[0], costs[0], batches[1], costs[1])
        np.testing.assert_allclose(ratio.variance_ratio, row.variance_ratio, rtol=1e-12)


def test_what_makes_no_sense_is_refused():
    blocks = sp.moments(np.random.default_rng(3).normal(size=(16, 10)))
    with pytest.raises(ValueError, match="too few blocks"):
        sp.efficiency(blocks[:3], np.ones(3), blocks, np.ones(16))
    with pytest.raises(ValueError, match="one cost for every block"):
        sp.efficiency(blocks, np.ones(3), blocks, np.ones(16))
    with pytest.raises(ValueError, match="shape"):
        sp.efficiency(np.ones((16, 10)), np.ones(16), blocks, np.ones(16))
    with pytest.raises(ValueError, match="two batches"):
        sp.estimate([1.0])
