"""The program from Python: `run` and `judge` start it as a process, so that Ctrl-C and its exit codes stay its own."""

from __future__ import annotations

import json
import math
import numbers
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas

from . import _core
from .records import Record, open, table


class ExperimentError(ValueError):
    """The program refused its input; the message is the program's own, with the place of every mistake."""


class Interrupted(KeyboardInterrupt):
    """The program was interrupted; the same call resumes where it stopped."""


def _start(arguments: list[str], expected: tuple[int, ...] = (0,)) -> subprocess.CompletedProcess:
    command = [sys.executable, "-m", "scatterproof", *arguments]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, encoding="utf-8")
    if done.returncode in expected:
        return done
    said = done.stderr.strip() or done.stdout.strip()
    if done.returncode == 130:
        raise Interrupted(said)
    if done.returncode == 2:
        raise ExperimentError(said)
    raise RuntimeError(f"exit code {done.returncode}: {said}")


def report(folder: Path) -> None:
    """Makes the views of a record again."""
    _start(["report", str(folder)])


_BARE = re.compile(r"[A-Za-z0-9_-]+")


def _toml(value: object) -> str:
    """A value as TOML, tables inline."""
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, os.PathLike):
        return _toml(os.fspath(value))
    if isinstance(value, numbers.Integral):
        return str(int(value))
    if isinstance(value, numbers.Real):
        number = float(value)
        return repr(number) if math.isfinite(number) else str(number)
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(key)} = {_toml(each)}" for key, each in value.items()) + " }"
    if isinstance(value, np.ndarray):
        return _toml(value.tolist())
    if isinstance(value, Iterable):
        return "[" + ", ".join(_toml(each) for each in value) + "]"
    raise TypeError(f"{value!r} has no form in TOML")


def _key(key: object) -> str:
    text = str(key)
    return text if _BARE.fullmatch(text) else json.dumps(text, ensure_ascii=False)


def to_toml(experiment: Mapping) -> str:
    """An experiment given as a dictionary, as the text of its file: a line for each key."""
    return "".join(f"{_key(key)} = {_toml(value)}\n" for key, value in experiment.items())


def run(
    experiment: str | os.PathLike | Mapping,
    *,
    out: str | os.PathLike = "results",
    setting: str | None = None,
    overrides: Mapping[str, object] = {},
    threads: int | None = None,
) -> Record:
    """Runs an experiment and opens its record.

    `experiment` is the path of a TOML file, the text of one (with a line break in it), or a dictionary with the
    same keys; paths in the latter two are relative to the working folder. What was run before is not run again.
    `overrides` are those of `--set`: dotted keys and their values.
    """
    arguments = ["--quiet", "--out", os.fspath(out)]
    if setting is not None:
        arguments += ["--setting", setting]
    for key, value in overrides.items():
        arguments += ["--set", f"{key}={_toml(value)}"]
    if threads is not None:
        arguments += ["--threads", str(threads)]
    if isinstance(experiment, Mapping):
        text = to_toml(experiment)
    elif isinstance(experiment, str) and "\n" in experiment:
        text = experiment
    else:
        return _opened(_start(["run", os.fspath(experiment), *arguments]))
    # Beside what it refers to: paths in a file are relative to the file.
    handle, path = tempfile.mkstemp(suffix=".toml", prefix=".experiment-", dir=".")
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        return _opened(_start(["run", path, *arguments]))
    finally:
        os.unlink(path)


def _opened(done: subprocess.CompletedProcess) -> Record:
    reports = [line for line in done.stdout.splitlines() if line.startswith("report: ")]
    return open(Path(reports[-1].removeprefix("report: ")).parent)


@dataclass(frozen=True)
class Judgement:
    """What the tests of another renderer's images found."""

    outcome: str
    """`pass`: no bias, and one of `detect` would have been found; `fail`; or `undecided`."""
    verdicts: pandas.DataFrame
    """A row for each test: image means, tiles, and all pixels together, by band."""
    text: str
    """What the program prints."""

    def __bool__(self) -> bool:
        return self.outcome == "pass"


def judge(
    images: Iterable[str | os.PathLike | np.ndarray],
    record: Record | str | os.PathLike,
    *,
    cell: str | None = None,
    estimator: str | None = None,
    light_class: str = "all",
    scale: float = 1.0,
    level: float | None = None,
    detect: float | None = None,
    independent_pixels: bool = False,
) -> Judgement:
    """Tests images of another renderer, each rendered with another seed, against a record.

    Images are paths of OpenEXR files, or arrays (row, column, band) of linear radiance with row 0 at the top
    and the record's bands in their order.
    """
    record = record if isinstance(record, Record) else open(record)
    with tempfile.TemporaryDirectory() as scratch:
        paths, channels = [], []
        for number, image in enumerate(images):
            if isinstance(image, (str, os.PathLike)):
                paths.append(os.fspath(image))
                continue
            array = np.asarray(image, dtype=np.float32)
            if array.ndim != 3 or array.shape[2] != len(record.bands):
                raise ValueError(f"image {number} has shape {array.shape}, not (row, column, {len(record.bands)})")
            path = Path(scratch) / f"image-{number:03}.exr"
            planes = [(f"band{b}", array[:, :, b].ravel().tolist()) for b in range(array.shape[2])]
            _core.write_exr(path, array.shape[1], array.shape[0], planes)
            paths.append(str(path))
            channels = [f"{band}=band{b}" for b, band in enumerate(record.bands)]
        views = Path(scratch) / "views"
        arguments = ["judge", "--reference", str(record.folder), "--out", str(views), "--verbose"]
        arguments += [word for channel in channels for word in ("--channel", channel)]
        options = {"cell": cell, "estimator": estimator, "class": light_class, "scale": scale}
        options |= {"level": level, "detect": detect}
        for name, value in options.items():
            if value is not None:
                arguments += [f"--{name}", str(value)]
        if independent_pixels:
            arguments.append("--independent-pixels")
        done = _start([*arguments, *paths], expected=(0, 1, 3))
        if not (views / "verdicts.csv").exists():
            raise RuntimeError(done.stderr.strip())
        verdicts = table(views / "verdicts.csv")
        outcome = {0: "pass", 1: "fail", 3: "undecided"}[done.returncode]
        return Judgement(outcome, verdicts, done.stdout)
