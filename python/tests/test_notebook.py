"""The notebook, run as its readers run it."""

import os
from pathlib import Path

import pytest

nbformat = pytest.importorskip("nbformat")
nbclient = pytest.importorskip("nbclient")

HERE = Path(__file__).parent
PHOTOS = Path(os.environ.get("SMALTI_PHOTOS", HERE.parents[1] / "tests" / "photos"))


def test_the_notebook_runs_and_shows_pictures(monkeypatch):
    monkeypatch.setenv("SMALTI_PHOTO", str(PHOTOS / "woman.jpg"))
    notebook = nbformat.read(HERE.parent / "examples" / "first_mosaic.ipynb", as_version=4)
    nbclient.NotebookClient(notebook, timeout=300, kernel_name="python3").execute()
    if kept := os.environ.get("SMALTI_KEEP_NOTEBOOK"):
        nbformat.write(notebook, kept)
    shown = {cell.id: [output for output in cell.get("outputs", [])] for cell in notebook.cells}
    for name in ["picture", "evolve", "styles", "tiles", "steer"]:
        assert any("image/png" in output.get("data", {}) for output in shown[name]), name
    assert "poster.png" in shown["save"][0]["text"]
