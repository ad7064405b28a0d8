"""`run`, `judge` and the program itself."""

import subprocess
import sysconfig
from pathlib import Path

import numpy as np
import pytest

import scatterproof
from scatterproof.program import to_toml

try:
    import tomllib
except ModuleNotFoundError:  # Python 3.10
    tomllib = None


def test_the_program_is_installed(program):
    for command in [str(Path(sysconfig.get_path("scripts")) / "scatterproof")], program:
        done = subprocess.run([*command, "--version"], capture_output=True, text=True, check=True)
        assert done.stdout == f"scatterproof {scatterproof.__version__}\n"
        assert subprocess.run([*command, "rum"], capture_output=True).returncode == 2


@pytest.mark.skipif(tomllib is None, reason="tomllib came with Python 3.11")
def test_a_dictionary_is_written_as_the_toml_that_reads_back(experiment):
    assert tomllib.loads(to_toml(experiment)) == experiment
    odd = {"a b": 'q"\\\n\té\x7f', "x": [1e300, -0.0, 1e-7, True], "t": [{"k": {}}], "n": np.float64(0.1)}
    assert tomllib.loads(to_toml(odd)) == {**odd, "n": 0.1}
    assert tomllib.loads(to_toml({"v": np.arange(3), "i": float("inf")})) == {"v": [0, 1, 2], "i": float("inf")}
    with pytest.raises(TypeError, match="None has no form in TOML"):
        to_toml({"a": None})


def test_text_file_and_dictionary_are_one_experiment(record, experiment, tmp_path):
    text = to_toml(experiment)
    file = tmp_path / "small.toml"
    file.write_text(text)
    for given in text, file:
        again = scatterproof.run(given, out=tmp_path, overrides={"sweep": []}, threads=1)
        assert again.entries["cells"][0]["content_hash"] == record.entries["cells"][0]["content_hash"]
        assert np.array_equal(again.run("analog").pixels, record.run("analog", 0).pixels)
        assert len(again.cells) == 1


def test_a_wrong_experiment_is_refused_with_its_place(experiment, tmp_path):
    wrong = {**experiment, "sead": 1}
    with pytest.raises(scatterproof.ExperimentError, match="unknown key `sead`"):
        scatterproof.run(wrong, out=tmp_path)
    with pytest.raises(scatterproof.ExperimentError, match="none.toml"):
        scatterproof.run("none.toml", out=tmp_path)


@pytest.fixture(scope="module")
def images(record):
    """Eight images of another renderer: the truth as the record has it, plus noise of one size."""
    draws = np.random.default_rng(7)
    truth = np.asarray(record.run("weighted", 0).pixels.sel(statistic="mean"))
    return [truth + 0.02 * draws.normal(size=truth.shape) for _ in range(8)]


def test_images_without_bias_are_not_found_biased(record, images):
    # The record has only 128 passes: a bias of 20 % would be seen in every band, one of 2 % would not.
    for detect, outcome in (0.2, "pass"), (0.02, "underpowered"):
        found = scatterproof.judge(
            images, record, cell="0.0", estimator="weighted", independent_pixels=True, detect=detect
        )
        assert found.outcome == "undecided", found.text
        assert not (found.verdicts["outcome"] == "fail").any(), found.text
        means = found.verdicts.query("observable == 'mean'")
        assert list(means["outcome"]) == [outcome] * 3, found.text


def test_a_biased_image_is_found(record, images):
    biased = [image * [1.0, 1.2, 1.0] for image in images]
    found = scatterproof.judge(biased, record, cell="0.0", estimator="weighted", independent_pixels=True)
    assert found.outcome == "fail" and not found
    failed = found.verdicts.query("outcome == 'fail' and observable == 'mean'")
    assert list(failed["band"]) == ["G"]


def test_images_of_another_size_are_refused(record, images):
    with pytest.raises(ValueError, match="row, column, 3"):
        scatterproof.judge([image[:, :, 0] for image in images], record, cell="0.0", estimator="weighted")
    with pytest.raises(scatterproof.ExperimentError, match="8 x 6"):
        scatterproof.judge([image[:4] for image in images], record, cell="0.0", estimator="weighted")
    with pytest.raises(scatterproof.ExperimentError, match="--estimator"):
        scatterproof.judge(images, record, cell="0.0")
