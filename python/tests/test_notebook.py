"""The notebook runs from top to bottom, and says what its text says."""

import shutil

import pytest

nbclient = pytest.importorskip("nbclient")
nbformat = pytest.importorskip("nbformat")


def test_the_notebook_runs(repository, tmp_path):
    path = repository / "examples" / "python" / "first-record.ipynb"
    shutil.copy(path, tmp_path)
    notebook = nbformat.read(path, as_version=4)
    nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}}).execute()
    outputs = [o for cell in notebook.cells if cell.cell_type == "code" for o in cell.outputs]
    assert any("image/png" in o.get("data", {}) for o in outputs)
    judged = "".join(o.get("text", "") for o in notebook.cells[-1].outputs).splitlines()
    assert len(judged) == 2, judged
    assert "'G': 'fail'" not in judged[0] and not judged[0].startswith("fail"), judged
    assert judged[1].startswith("fail") and "'G': 'fail'" in judged[1], judged
    assert "'R': 'fail'" not in judged[1], judged
