"""The digest of the sources changes with code and not with words; the kept report was made by this code."""

from __future__ import annotations

import json
import pathlib

import pytest

from hqp_rp.compare.claims import sources
from hqp_rp.compare.claims.sources import code_of, digest_of_sources

ROOT = pathlib.Path(__file__).parents[3]
KEPT = ROOT / "docs" / "reports" / "paper_claims" / "run.json"

CODE = '''"""Words."""

import math  # more words


def half(x):
    """Half of x.

    Args: x.
    """
    # why
    y = "# no comment"  # a comment
    return x / 2.0


LIMIT = 3
"""What it is."""
'''


def test_words_do_not_count_and_code_does(tmp_path: pathlib.Path) -> None:
    path = tmp_path / "module.py"
    path.write_text(CODE)
    code = code_of(path)
    assert "ords" not in code
    assert "why" not in code
    assert "What it is" not in code
    assert "# no comment" in code
    path.write_text(CODE.replace("Half of x", "Halves").replace("# why", "# because").replace("more words", "é"))
    assert code_of(path) == code
    path.write_text(CODE.replace("x / 2.0", "(\n        x / 2.0\n    )"))
    assert code_of(path) == code
    path.write_text("import ast\n" + CODE)
    assert code_of(path) == code  # nothing uses it
    uses = CODE + "\nTREE = ast.Module, math.pi\n"
    path.write_text("import ast\n" + uses)
    more = code_of(path)
    path.write_text(uses.replace("import math", "import math\nimport ast"))
    assert code_of(path) == more
    path.write_text(uses.replace("import math", "import math\nimport other as ast"))
    assert code_of(path) != more != code
    path.write_text(CODE.replace("/ 2.0", "/ 3.0"))
    assert code_of(path) != code
    native = tmp_path / "kernel.hpp"
    native.write_text("int a = 1;  // one\n/* more\nlines */\n")
    assert code_of(native) == "int a = 1;"
    native.write_text("int\n  a = 1;\n")
    assert code_of(native) == "int a = 1;"


def test_where_compare_keeps_a_shared_name_does_not_count_and_the_name_does(tmp_path: pathlib.Path) -> None:
    path = tmp_path / "module.py"

    def code(imports: str) -> str:
        path.write_text(f"{imports}\ndigest(mean(number))\n")
        return code_of(path)

    ours = "from hqp_rp.compare.run_folder import digest\nfrom hqp_rp.compare.report import number\n"
    moved = "from hqp_rp.compare.files.folder import digest, number\n"
    measures = "from hqp_rp.compare.claims.outcomes import mean"
    before = code(ours + measures)
    assert code(moved + measures) == before
    assert code(moved + measures.replace("outcomes", "algebra")) != before
    assert code(moved.replace("import digest", "import digits as digest") + measures) != before
    assert code("from hqp_rp.core.files import digest, number\n" + measures) != before


def test_how_an_object_is_shown_does_not_count(tmp_path: pathlib.Path) -> None:
    path = tmp_path / "record.py"

    def code(body: str) -> str:
        path.write_text(f"class Record:\n    size: int = 3\n{body}")
        return code_of(path)

    bare = code("")
    shown = "    def _repr_html_(self):\n        from hqp_rp.core.html import table\n        return table(self)\n"
    assert code(shown) == code(shown.replace("_repr_html_", "plot")) == bare
    assert code(shown.replace("_repr_html_", "solve")) != bare


def test_a_line_up_of_variants_changes_no_solver(tmp_path: pathlib.Path) -> None:
    path = tmp_path / "solver.py"

    def code(imports: str, body: str) -> str:
        path.write_text(f"{imports}\nclass Method(Solver):\n{body}    damping: Damping = NoDamping()\n")
        return code_of(path)

    bare = code("from hqp_rp.core.damping import Damping, NoDamping\nfrom hqp_rp.core.solver import Solver", "")
    imports = (
        "from hqp_rp.core.damping import ConstantDamping, Damping, NoDamping\n"
        "from hqp_rp.core.solver import Solver\nfrom hqp_rp.core.variant import Variant"
    )
    declared = '    variants: ClassVar[tuple[Variant, ...]] = (Variant("a", {"damping": ConstantDamping(0.1)}),)\n'
    assert code(imports, declared) == bare
    assert code(imports, declared.replace("variants:", "damp:")) != bare
    used = imports.replace("NoDamping", "ConstantDamping as NoDamping")
    assert code(used, declared) != bare


def test_a_module_that_only_variants_need_is_no_source(tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "core").mkdir()
    (tmp_path / "core" / "variant.py").write_text("")
    (tmp_path / "core" / "solver.py").write_text("")
    method = tmp_path / "method.py"
    text = "from hqp_rp.core.solver import Solver\nfrom hqp_rp.core.variant import Variant\n\nclass M(Solver):\n    "
    monkeypatch.setattr(sources, "ROOT", tmp_path)
    monkeypatch.setattr(sources, "_NATIVE", tmp_path / "native")
    monkeypatch.setattr(sources, "_BEGINNINGS", ("hqp_rp.method",))
    monkeypatch.setattr(sources, "solvers", list)
    method.write_text(text + "variants = (Variant(),)\n")
    assert [path.name for path in sources.sources()] == ["solver.py", "method.py"]
    method.write_text(text + "other = (Variant(),)\n")
    assert [path.name for path in sources.sources()] == ["solver.py", "variant.py", "method.py"]


def test_everything_that_makes_a_result_is_among_the_sources() -> None:
    names = {path.relative_to(sources.ROOT).as_posix() for path in sources.sources()}
    for name in (
        "compare/claims/experiments.py",
        "compare/claims/trials.py",
        "compare/claims/verdicts.py",
        "compare/claims/judges/rivals.py",
        "scenarios/_contact.py",
        "scenarios/sawyer_push_response.py",
        "control/admittance.py",
        "robot/arms.py",
        "solvers/reverse_priority.py",
        "core/native/include/hqp_rp/reverse_priority.hpp",
    ):
        assert name in names
    assert all("claims" in name for name in names if name.startswith("compare"))
    assert not [name for name in names if name.startswith("compare/claims/charts") or name.endswith(".j2")]
    assert "solvers/hierarchical_active_set.py" in names
    assert "solvers/jparse.py" not in names  # takes no part in the claims


def test_the_digest_follows_a_file(tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.py"
    path.write_text("x = 1\n")
    monkeypatch.setattr(sources, "ROOT", tmp_path)
    monkeypatch.setattr(sources, "sources", lambda: [path])
    before = digest_of_sources()
    path.write_text("x = 1  # one\n")
    assert digest_of_sources() == before
    path.write_text("x = 2\n")
    assert digest_of_sources() != before


def test_the_kept_report_was_made_by_this_code() -> None:
    run = json.loads(KEPT.read_text())["run"]
    assert run["study"] == "full"
    assert run["sources"] == digest_of_sources(), (
        "docs/reports/paper_claims was made by other code: remake it with "
        "`hqp-rp claims --output docs/reports/paper_claims --overwrite` (some 20 minutes on two cores)."
    )
