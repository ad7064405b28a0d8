"""What `open` gives: arrays with names, tables, intervals, and refusals."""

import re
import shutil

import numpy as np
import pandas
import pytest

import scatterproof
from scatterproof import _core


def test_arrays_have_names_and_the_shapes_that_they_promise(record):
    assert [cell.label for cell in record.cells] == ["0.0", "0.8"]
    assert record.bands == ["R", "G", "B"]
    run = record.run("analog", cell="0.8")
    assert run.moments.axes == ("batch", "observable", "band", "moment")
    assert run.moments.sizes["observable"] == len(run.observables)
    assert run.pixels.sizes == {"statistic": 2, "row": 6, "column": 8, "band": 3}
    assert run.spread.axes == ("batch", "band", "moment")
    assert run.costs.labels["counter"] == tuple(sorted(run.costs.labels["counter"]))
    assert run.guide is None
    red = run.pixels.sel(statistic="mean", band="R")
    assert red.axes == ("row", "column")
    assert np.array_equal(red, np.asarray(run.pixels)[0, :, :, 0])
    with pytest.raises(KeyError, match="axis band has no 'X'; it has R, G, B"):
        run.pixels.sel(band="X")
    with pytest.raises(KeyError, match="no axis 'wavelength'"):
        run.pixels.sel(wavelength=0)
    with pytest.raises(KeyError, match="2 cells"):
        record.run("analog")


def test_costs_by_batch_add_up_to_the_run(record):
    for run in record.run("analog", 0), record.run("weighted", 1):
        totals = dict(zip(run.costs.labels["counter"], np.asarray(run.costs).sum(axis=0)))
        assert totals == run._entry["cost"]


def test_means_are_those_of_the_table(record):
    rows = record.measurements()
    assert isinstance(rows, pandas.DataFrame)
    assert len(rows) == sum(len(r.observables) * 3 for c in record.cells for r in c.runs)
    for cell in record.cells:
        for run in cell.runs:
            own = rows[(rows["cell"] == cell.label) & (rows["estimator"] == run.estimator)]
            own = own[(own["observable"] == "mean") & (own["class"] == "all")]
            assert list(own["band"]) == ["R", "G", "B"]
            found = run.estimate("mean")
            np.testing.assert_allclose(found.value, own["mean"], rtol=1e-13)
            # The table's error is of all passes, that of `estimate` of batches: the same from moments by numpy.
            n, mean, m2 = np.moveaxis(np.asarray(run.moments.sel(observable="mean"))[..., :3], -1, 0)
            square = (m2 + n * (mean - found.value) ** 2).sum(axis=0)
            np.testing.assert_allclose(own["std_error"], np.sqrt(square / (127 * 128)), rtol=1e-10)
            batches = np.sqrt((n * (mean - found.value) ** 2).sum(axis=0) / ((len(n) - 1) * 128))
            np.testing.assert_allclose(found.std_error, batches, rtol=1e-10)
            low, high = found.interval()
            assert np.all((low < found.value) & (found.value < high))
            assert run.estimate("mean", band="G").value == found.value[1]


def test_the_mean_observable_is_the_mean_of_the_pixels(record):
    run = record.run("weighted", 0)
    pixels = np.asarray(run.pixels.sel(statistic="mean")).mean(axis=(0, 1))
    np.testing.assert_allclose(run.estimate("mean").value, pixels, rtol=1e-12)
    assert run.rgb().shape == (6, 8, 3)


def test_tables_are_frames(record):
    verdicts = record.verdicts()
    assert set(verdicts["outcome"]) <= {"pass", "fail", "underpowered", "invalid"}
    assert len(verdicts) > 0
    comparisons = record.comparisons()
    assert comparisons["variance_ratio"].dtype == float
    assert record.model_errors().empty


def test_tables_are_made_again_where_they_are_missing(record, tmp_path):
    copy = tmp_path / "small"
    shutil.copytree(record.folder, copy)
    for name in ["summary.json", "measurements.csv"]:
        (copy / name).unlink()
    again = scatterproof.open(copy)
    pandas.testing.assert_frame_equal(again.measurements(), record.measurements())


def test_a_damaged_record_is_refused(record, tmp_path):
    copy = tmp_path / "small"
    shutil.copytree(record.folder, copy)
    path = copy / "record" / "cells" / "000" / "000.pixels.npy"
    data = bytearray(path.read_bytes())
    data[-1] ^= 1
    path.write_bytes(data)
    with pytest.raises(scatterproof.RecordError, match="000.pixels.npy"):
        scatterproof.open(copy)
    assert scatterproof.open(copy, check=False).name == "small"
    with pytest.raises(scatterproof.RecordError, match="no record here"):
        scatterproof.open(tmp_path)


def test_the_page_documents_the_axes_that_arrays_have(record, repository):
    page = (repository / "docs" / "record-layout.md").read_text()
    rows = dict(re.findall(r"^\| `[^`|]*?\.(\w+)\.npy` \| `\[([\w, ]+)\]` \|", page, re.M))
    assert len(rows) == 8, rows
    for what, axes in rows.items():
        assert _core.axes(f"cells/000/000.{what}.npy") == axes.split(", "), what
