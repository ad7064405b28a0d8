"""scatterproof in Python: run experiments, read records as numpy arrays, judge images, compare estimators.

    import scatterproof
    record = scatterproof.run("experiments/quickstart.toml")
    record.measurements()                        # pandas
    run = record.run("snee")
    run.pixels.sel(statistic="mean")             # an array with names of axes

The program itself is `scatterproof` on the command line, or `python -m scatterproof`.
"""

from ._core import RecordError, __version__
from .arrays import LabelledArray
from .program import ExperimentError, Judgement, Interrupted, judge, run
from .records import Cell, EstimatorRun, Record, open
from .statistics import Estimates, Ratio, Welch, efficiency, estimate, moments, paired, welch

__all__ = [
    "Cell",
    "EstimatorRun",
    "Estimates",
    "ExperimentError",
    "Interrupted",
    "Judgement",
    "LabelledArray",
    "Ratio",
    "Record",
    "RecordError",
    "Welch",
    "__version__",
    "efficiency",
    "estimate",
    "judge",
    "moments",
    "open",
    "paired",
    "run",
    "welch",
]
