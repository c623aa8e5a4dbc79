"""An output folder belongs to one run."""

from __future__ import annotations

import json
from pathlib import Path

import polars as pl
import pytest

from hqp_rp import FileError
from hqp_rp.compare.run_folder import RunFolder, digest, write_atomically

RUN = {"kind": "compare", "seeds": 1}


def test_parts_come_back_and_the_same_run_goes_on(tmp_path: Path) -> None:
    frame = pl.DataFrame({"x": [[1.0, 0.1], None], "name": ["a", "b"]})
    RunFolder(tmp_path / "run", RUN).save("0123", frame)
    again = RunFolder(tmp_path / "run", RUN)
    assert again.has("0123")
    assert not again.has("4567")
    assert again.load(["0123", "0123"]).equals(pl.concat([frame, frame]))
    assert [path.name for path in (tmp_path / "run" / "parts").iterdir()] == ["0123.parquet"]


def test_another_run_is_refused_and_says_what_differs(tmp_path: Path) -> None:
    RunFolder(tmp_path, RUN)
    with pytest.raises(FileError, match=r"another run \(it differs in seeds\).*--overwrite"):
        RunFolder(tmp_path, {**RUN, "seeds": 2})


def test_overwriting_removes_what_the_other_run_wrote_and_nothing_else(tmp_path: Path) -> None:
    first = RunFolder(tmp_path, RUN, files=["report.md", "figures"])
    first.save("0123", pl.DataFrame({"x": [1]}))
    (tmp_path / "figures").mkdir()
    (tmp_path / "figures" / "a.png").write_bytes(b"")
    (tmp_path / "report.md").write_text("old")
    (tmp_path / "notes.txt").write_text("mine")
    second = RunFolder(tmp_path, {**RUN, "seeds": 2}, overwrite=True)
    assert not second.has("0123")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["notes.txt", "parts", "run.json"]


def test_overwriting_never_leaves_the_folder(tmp_path: Path) -> None:
    outside = tmp_path / "keep.txt"
    outside.write_text("mine")
    RunFolder(tmp_path / "run", RUN)
    manifest = tmp_path / "run" / "run.json"
    content = json.loads(manifest.read_text())
    content["files"].append("../keep.txt")
    manifest.write_text(json.dumps(content))
    RunFolder(tmp_path / "run", {**RUN, "seeds": 2}, overwrite=True)
    assert outside.read_text() == "mine"


def test_foreign_files_are_refused_even_with_overwrite(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("mine")
    with pytest.raises(FileError, match="files that hqp-rp did not write"):
        RunFolder(tmp_path, RUN, overwrite=True)
    (tmp_path / "run.json").write_text('{"format": "something else"}')
    with pytest.raises(FileError, match="not the manifest"):
        RunFolder(tmp_path, RUN, overwrite=True)
    assert (tmp_path / "thesis.tex").exists()


def test_a_file_or_an_impossible_place_is_named(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("")
    with pytest.raises(FileError, match="is a file"):
        RunFolder(file, RUN)
    with pytest.raises(FileError, match="cannot be used"):
        RunFolder(file / "below", RUN)
    with pytest.raises(FileError, match="cannot be written"):
        write_atomically(tmp_path / "none" / "a", b"")


def test_a_damaged_part_is_named(tmp_path: Path) -> None:
    folder = RunFolder(tmp_path, RUN)
    folder.part("0123").write_bytes(b"PAR1 no parquet")
    with pytest.raises(FileError, match=r"0123\.parquet.*delete it"):
        folder.load(["0123"])


def test_the_digest_keeps_texts_apart() -> None:
    assert digest("ab", "c") != digest("a", "bc")
    assert digest("ab", "c") == digest("ab", "c")
    assert len(digest("a")) == 16
