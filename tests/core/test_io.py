"""Problems as files: every float comes back, and a file that is not one gets a clear error."""

import json
import pathlib
import stat

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hqp_rp import FileError, Level, Problem, SettingError, load_problem, save_problem
from hqp_rp.core.io import VERSION, load_metadata
from tests.problems import badly_scaled, equality_cases, two_sided


def same(a: Problem, b: Problem) -> bool:
    levels = all(np.array_equal(getattr(a, k), getattr(b, k)) for k in ("matrix", "lower", "upper", "offsets"))
    if (a.hard is None) != (b.hard is None):
        return False
    hard = a.hard is None or all(
        np.array_equal(getattr(a.hard, k), getattr(b.hard, k)) for k in ("A", "lower", "upper")
    )
    return levels and hard and a.names == b.names and (a.hard is None or a.hard.name == b.hard.name)  # type: ignore[union-attr]


@pytest.mark.parametrize("problem", [p for _, p in equality_cases(1)] + [two_sided(1, box=0.5), badly_scaled(2)])
def test_round_trip(problem: Problem, tmp_path: pathlib.Path) -> None:
    path = save_problem(problem, tmp_path / "case.npz")
    assert path == tmp_path / "case.npz"
    loaded = load_problem(path)
    assert same(loaded, problem)
    assert loaded.is_equality == problem.is_equality
    assert [p.name for p in tmp_path.iterdir()] == ["case.npz"]


finite = st.floats(allow_nan=False, allow_infinity=False)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.tuples(finite, finite, finite), min_size=1, max_size=4), st.text(max_size=8))
def test_every_float_and_name_comes_back(tmp_path_factory: pytest.TempPathFactory, rows: list, name: str) -> None:
    array = np.array(rows)
    problem = Problem([Level.equality(array[:, :2], array[:, 2], name=name)])
    path = save_problem(problem, tmp_path_factory.mktemp("io") / "case.npz")
    loaded = load_problem(path)
    assert loaded.matrix.tobytes() == problem.matrix.tobytes()
    assert loaded.lower.tobytes() == problem.lower.tobytes()
    assert loaded.names == tuple(n.rstrip("\0") or "level 1" for n in problem.names)


def test_metadata(tmp_path: pathlib.Path) -> None:
    path = save_problem(two_sided(0), tmp_path / "a.npz", seed=np.int64(3), x=np.arange(2.0), solver="null_space")
    assert load_metadata(path) == {"seed": 3, "x": [0.0, 1.0], "solver": "null_space"}
    with pytest.raises(SettingError, match="metadata cannot be kept: a set"):
        save_problem(two_sided(0), tmp_path / "b.npz", what={1})


def test_replaces_a_file_and_respects_the_umask(tmp_path: pathlib.Path) -> None:
    path = tmp_path / "case.npz"
    path.write_text("old")
    save_problem(two_sided(0), path)
    assert same(load_problem(path), two_sided(0))
    plain = tmp_path / "plain"
    plain.touch()
    assert stat.S_IMODE(path.stat().st_mode) == stat.S_IMODE(plain.stat().st_mode)


def test_missing_and_unwritable(tmp_path: pathlib.Path) -> None:
    with pytest.raises(FileError, match=r"none\.npz: there is no such file"):
        load_problem(tmp_path / "none.npz")
    with pytest.raises(FileError, match=r"case\.npz: the problem cannot be written"):
        save_problem(two_sided(0), tmp_path / "no" / "case.npz")
    with pytest.raises(FileError, match="not readable"):
        load_problem(tmp_path)


def test_damaged_at_any_place(tmp_path: pathlib.Path) -> None:
    path = save_problem(two_sided(0, box=1.0), tmp_path / "case.npz")
    data = path.read_bytes()
    for cut in (0, 1, 10, len(data) // 3, len(data) // 2, len(data) - 1):
        path.write_bytes(data[:cut])
        with pytest.raises(FileError, match=r"case\.npz"):
            load_problem(path)
    rng = np.random.default_rng(0)
    for position in rng.integers(0, len(data), 60):
        broken = bytearray(data)
        broken[position] ^= 0xFF
        path.write_bytes(bytes(broken))
        try:
            loaded = load_problem(path)
        except FileError:
            continue
        assert same(loaded, two_sided(0, box=1.0))  # a byte that nothing depends on, such as a date


def rewritten(path: pathlib.Path, **changes: object) -> None:
    with np.load(path) as archive:
        arrays = {name: archive[name] for name in archive.files}
    arrays |= {k: np.array(v) for k, v in changes.items() if v is not None}
    for name in [k for k, v in changes.items() if v is None]:
        del arrays[name]
    np.savez(path, **arrays)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        (
            {"version": VERSION + 1},
            f"format version {VERSION + 1}; this release of hqp_rp reads versions 1 to {VERSION}",
        ),
        ({"version": None}, "format version None"),
        ({"format": "something else"}, "not a problem file"),
        ({"format": None}, "not a problem file"),
        ({"matrix": None}, "the array 'matrix' is missing"),
        ({"hard_lower": None}, "the array 'hard_lower' is missing"),
        ({"matrix": np.full((13, 7), np.nan)}, "must be finite"),
        ({"offsets": [0, 99]}, "must rise from 0"),
        ({"names": ["a"]}, "1 names for 3 levels"),
        ({"metadata": "{"}, "metadata is not a JSON object"),
        ({"metadata": json.dumps([1])}, "metadata is a list"),
    ],
)
def test_wrong_contents(tmp_path: pathlib.Path, changes: dict[str, object], text: str) -> None:
    path = save_problem(two_sided(0, box=1.0), tmp_path / "case.npz")
    rewritten(path, **changes)
    with pytest.raises(FileError, match=text) as error:
        load_problem(path)
    assert "case.npz" in str(error.value)


def test_other_numpy_files(tmp_path: pathlib.Path) -> None:
    np.save(tmp_path / "one.npy", np.eye(2))
    with pytest.raises(FileError, match=r"one\.npy: not a \.npz file"):
        load_problem(tmp_path / "one.npy")
    np.savez(tmp_path / "pickled.npz", format=np.array([{}], dtype=object))
    with pytest.raises(FileError, match=r"pickled\.npz"):
        load_problem(tmp_path / "pickled.npz")
    (tmp_path / "text.npz").write_text("hello")
    with pytest.raises(FileError, match=r"text\.npz"):
        load_problem(tmp_path / "text.npz")
