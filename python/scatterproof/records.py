"""Records as numpy arrays with names, and their tables as pandas frames."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas

from . import _core
from .arrays import LabelledArray
from .statistics import Estimates, estimate


# Columns of the program's tables that hold text, even where it looks like a number, as a cell's label may.
TEXT = {
    *("experiment", "cell", "band", "estimator", "estimators", "observable", "class", "metric", "baseline"),
    *("candidate", "model", "transport", "cost", "note", "claim", "test", "outcome"),
}


def table(path: Path) -> pandas.DataFrame:
    """A table of the program: numbers read back exactly, absent ones as NaN."""
    frame = pandas.read_csv(path, dtype=str, keep_default_na=False)
    for column in frame.columns.difference(TEXT):
        values = frame[column]
        if values.isin(["true", "false"]).all():
            frame[column] = values == "true"
        else:
            frame[column] = values.replace("", "nan").to_numpy(dtype=str).astype(float)
    return frame


class EstimatorRun:
    """One estimator in one cell."""

    def __init__(self, record: Record, cell: Cell, entry: dict):
        self._record, self._cell, self._entry = record, cell, entry
        self.estimator: str = entry["estimator"]
        self.kind: str = entry["kind"]
        self.passes: int = entry["passes"]
        self.notes: list[str] = entry["notes"]
        self.anomalies: dict[str, int] = entry["anomalies"]
        self.control_of: str | None = entry["control_of"]

    @property
    def observables(self) -> list[str]:
        """Names of the observables, `mean` or `mean:single` where the class is not `all`."""
        return [
            o["name"] if o["class"] == "all" else f"{o['name']}:{o['class']}" for o in self._entry["observables"]
        ]

    def _array(self, path: str | None) -> LabelledArray | None:
        if path is None:
            return None
        labels = {"observable": self.observables, "counter": sorted(self._entry["cost"])}
        return self._record._labelled(path, labels)

    @cached_property
    def moments(self) -> LabelledArray:
        """The moments of every observable: (batch, observable, band, moment)."""
        return self._array(self._entry["moments"])

    @cached_property
    def costs(self) -> LabelledArray:
        """Counts of work: (batch, counter)."""
        return self._array(self._entry["costs"])

    @cached_property
    def pixels(self) -> LabelledArray | None:
        """The image: (statistic, row, column, band), rows from the top. None where the sensor has no pixels."""
        image = self._entry["image"]
        return image and self._array(image["pixels"])

    @cached_property
    def spread(self) -> LabelledArray | None:
        """The variance of a pixel in one pass, from pairs of passes: (batch, band, moment)."""
        image = self._entry["image"]
        return image and self._array(image["spread"])

    @cached_property
    def guide(self) -> LabelledArray | None:
        """What guides its walks in the plane through the body's middle: (band, row, column, guide)."""
        return self._array(self._entry.get("guide", {}).get("array"))

    @property
    def cpu_seconds(self) -> np.ndarray | None:
        """CPU seconds of every batch, where they were measured; they are of one machine and no part of the record."""
        cells = self._record.timing.get("batches", {})
        batches = cells.get(self._cell.label, {}).get(self.estimator)
        return batches and np.array(batches["cpu_seconds"])

    def estimate(self, observable: str = "mean", band: str | None = None) -> Estimates:
        """The mean of an observable with its standard error: of one band, or an array over all bands."""
        batches = self.moments.sel(observable=observable)
        if band is not None:
            batches = batches.sel(band=band)
        return estimate(batches, are_moments=True)

    def rgb(self) -> np.ndarray:
        """The picture in linear sRGB, (row, column, 3): what the program shows before it encodes it."""
        if self.pixels is None:
            raise ValueError(f"{self.estimator} has no picture: its sensor has no pixels")
        colours = np.array([band["display_rgb"] for band in self._record.entries["bands"]])
        return self.pixels.values[0] @ colours

    def __repr__(self) -> str:
        return f"EstimatorRun({self.estimator}, {self.passes} passes)"


class Cell:
    """One point of the sweep."""

    def __init__(self, record: Record, entry: dict):
        self.label: str = entry["label"]
        self.axes: dict[str, str] = entry["axes"]
        self.runs = [EstimatorRun(record, self, run) for run in entry["runs"]]

    def __repr__(self) -> str:
        return f"Cell({self.label!r}, {', '.join(run.estimator for run in self.runs)})"


class Record:
    """A results folder that was read and checked; `open` makes it."""

    def __init__(self, folder: Path):
        self.folder = folder
        text = (folder / "record" / "record.json").read_text(encoding="utf-8")
        self.entries: dict = json.loads(text)
        """`record.json` as it is."""
        if self.entries["schema_version"] != _core.SCHEMA_VERSION:
            found, known = self.entries["schema_version"], _core.SCHEMA_VERSION
            raise _core.RecordError(f"{folder}: records of version {found} are not read, only of version {known}")
        self.name: str = self.entries["experiment"]
        self.bands: list[str] = [band["name"] for band in self.entries["bands"]]
        self.cells = [Cell(self, cell) for cell in self.entries["cells"]]

    @cached_property
    def timing(self) -> dict:
        """`timing.json`, or nothing: seconds of one machine, beside the record."""
        path = self.folder / "timing.json"
        return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}

    def run(self, estimator: str | None = None, cell: str | int | None = None) -> EstimatorRun:
        """The run of an estimator in a cell, by label or number. Either may be left out where there is one."""
        cells = self.cells if cell is None else [self._cell(cell)]
        if len(cells) != 1:
            raise KeyError(f"the record has {len(cells)} cells: {', '.join(repr(c.label) for c in cells)}")
        runs = [run for run in cells[0].runs if estimator is None or run.estimator == estimator]
        if len(runs) != 1:
            names = ", ".join(run.estimator for run in cells[0].runs)
            raise KeyError(f"{estimator!r} names no single estimator; there are {names}")
        return runs[0]

    def _cell(self, cell: str | int) -> Cell:
        if isinstance(cell, int):
            return self.cells[cell]
        found = [c for c in self.cells if c.label.replace(" ", "") == cell.replace(" ", "")]
        if not found:
            raise KeyError(f"no cell {cell!r}; there are {', '.join(repr(c.label) for c in self.cells)}")
        return found[0]

    def _labelled(self, path: str, labels: dict[str, Sequence[str]]) -> LabelledArray:
        axes = _core.axes(path)
        if axes is None:
            raise _core.RecordError(f"{path} is no array that this version knows")
        values = np.load(self.folder / "record" / path, mmap_mode="r", allow_pickle=False)
        names = {
            "band": self.bands,
            "moment": _core.MOMENTS,
            "statistic": _core.STATISTICS,
            "guide": _core.GUIDE,
            "count": _core.BIN_ROWS,
            **labels,
        }
        return LabelledArray(values, axes, {axis: names[axis] for axis in axes if axis in names})

    @cached_property
    def samplers(self) -> dict[str, dict[str, LabelledArray]]:
        """The bins of every sampler by its name: `coarse`, and `fine` and `serial` where there are any."""
        entries = self.entries.get("samplers", [])
        kinds = ("coarse", "fine", "serial")
        return {e["sampler"]: {k: self._labelled(e[k], {}) for k in kinds if e.get(k)} for e in entries}

    def measurements(self) -> pandas.DataFrame:
        """Every mean with its standard error, a row for each cell, estimator, observable and band."""
        return self._table("measurements.csv")

    def comparisons(self) -> pandas.DataFrame:
        """Efficiencies of pairs of estimators with their intervals."""
        return self._table("comparisons.csv")

    def verdicts(self) -> pandas.DataFrame:
        """The verdicts on the record's claims, judged by itself."""
        return self._table("verdicts.csv")

    def model_errors(self) -> pandas.DataFrame:
        """Errors of models against light transport; no rows where there is no model."""
        return self._table("model_errors.csv")

    def _table(self, name: str) -> pandas.DataFrame:
        if not (self.folder / "summary.json").exists():
            from .program import report

            report(self.folder)
        path = self.folder / name
        if not path.exists() or path.stat().st_size == 0:
            return pandas.DataFrame()
        return table(path)

    def __repr__(self) -> str:
        estimators = dict.fromkeys(run.estimator for cell in self.cells for run in cell.runs)
        return f"Record({self.name}: {len(self.cells)} cells, {', '.join(estimators)}; bands {', '.join(self.bands)})"


def open(folder: str | os.PathLike, *, check: bool = True) -> Record:  # noqa: A001
    """Reads the record of a results folder, such as `results/quickstart`.

    `check` has the program verify version, checksums and shapes of all arrays; without it arrays are read
    only when they are used.
    """
    path = Path(folder)
    if path.name == "record" and (path / "record.json").exists():
        path = path.parent
    if check or not (path / "record" / "record.json").exists():
        _core.check(path)
    return Record(path)
