"""The rules of the code base that a parser can hold, and proof that each can fail."""

import ast
import dataclasses
import pathlib
import re
from collections.abc import Iterator

import jax.numpy as jnp
import jaxtyping
import pytest
from elastax._checks import check_values


ROOT = pathlib.Path(__file__).resolve().parent.parent
PRIVATE = "_*"
STACK = (
    PRIVATE,
    "kinematics",
    "structure",
    "signals",
    "drivetrain",
    "dynamics",
    "analysis",
    "inverse",
    "identification",
    "control",
    "trajectory",
    "io",
    "robots",
    "plotting",
    "cli",
)
LONGEST = 500


@dataclasses.dataclass(frozen=True)
class Source:
    """One module: its dotted name, whether it is a package's `__init__`, its text."""

    name: str
    text: str
    is_package: bool = False

    @property
    def tree(self) -> ast.Module:
        return ast.parse(self.text)

    @property
    def layer(self) -> str | None:
        """Place in the stack; None for the `__init__` of the top level."""
        return _layer(self.name)


def _layer(name: str) -> str | None:
    parts = name.split(".")
    if len(parts) == 1:
        return None
    return PRIVATE if parts[1].startswith("_") else parts[1]


def _sources() -> list[Source]:
    found = []
    for path in sorted((ROOT / "elastax").rglob("*.py")):
        parts = path.relative_to(ROOT).with_suffix("").parts
        is_package = parts[-1] == "__init__"
        name = ".".join(parts[:-1] if is_package else parts)
        found.append(Source(name, path.read_text(encoding="utf-8"), is_package))
    return found


def _classes(sources: list[Source]) -> Iterator[tuple[Source, ast.ClassDef]]:
    for source in sources:
        for node in ast.walk(source.tree):
            if isinstance(node, ast.ClassDef):
                yield source, node


def _is_abstract(name: str) -> bool:
    return name.lstrip("_").startswith("Abstract")


def _bases(node: ast.ClassDef) -> list[str]:
    """Names of the bases, without module prefix and type arguments."""
    bases = [
        base.value if isinstance(base, ast.Subscript) else base for base in node.bases
    ]
    return [ast.unparse(base).split(".")[-1] for base in bases]


def _methods(node: ast.ClassDef) -> dict[str, bool]:
    """Methods of a class; the value says whether it is abstract."""
    return {
        item.name: any(
            ast.unparse(decorator).split(".")[-1] == "abstractmethod"
            for decorator in item.decorator_list
        )
        for item in node.body
        if isinstance(item, ast.FunctionDef)
    }


# ---------------------------------------------------------------------------- imports


def _imported(source: Source) -> Iterator[str]:
    """Absolute dotted names of what a module imports, names after `from` included."""
    package = source.name.split(".")
    for node in ast.walk(source.tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            levels = node.level - (1 if source.is_package else 0)
            base = package[: len(package) - levels] if node.level else []
            base = base + (node.module.split(".") if node.module else [])
            yield from (".".join([*base, alias.name]) for alias in node.names)


def check_import_stack(sources: list[Source]) -> list[str]:
    """Imports run down `STACK`; a package imports itself and lower ones only."""
    complaints = []
    for source in sources:
        if source.layer is None:
            continue
        if source.layer not in STACK:
            complaints.append(f"{source.name} has no place in the stack")
            continue
        for name in _imported(source):
            if name.split(".")[0] != "elastax":
                continue
            layer = _layer(name)
            if layer not in STACK:
                complaints.append(f"{source.name} imports {name} from the top level")
            elif STACK.index(layer) > STACK.index(source.layer):
                complaints.append(f"{source.name} imports {name}, which is higher")
    return complaints


def check_import_style(sources: list[Source]) -> list[str]:
    """No star, no postponed annotations, no hidden cycle; matplotlib in one place."""
    complaints = []
    for source in sources:
        for name in _imported(source):
            if name.endswith(".*"):
                complaints.append(f"{source.name} imports {name}")
            if name == "__future__.annotations":
                complaints.append(f"{source.name} postpones annotations")
            if name.split(".")[-1] == "TYPE_CHECKING":
                complaints.append(f"{source.name} imports under TYPE_CHECKING")
            if name.split(".")[0] == "matplotlib" and source.layer != "plotting":
                complaints.append(f"{source.name} imports matplotlib")
    return complaints


# ---------------------------------------------------------------------------- classes


def check_abstract_or_final(sources: list[Source]) -> list[str]:
    """A class is abstract and says so, or final; nothing concrete is overridden."""
    known = {node.name: node for _, node in _classes(sources)}
    complaints = []
    for source, node in _classes(sources):
        name = f"{source.name}.{node.name}"
        has_abstract = any(_methods(node).values())
        if _is_abstract(node.name) and not has_abstract:
            complaints.append(f"{name} has no abstractmethod")
        if has_abstract and not _is_abstract(node.name):
            complaints.append(f"{name} is abstract: its name must start with Abstract")
        for base in _bases(node):
            if base not in known:
                continue
            if not _is_abstract(base):
                complaints.append(f"{name} inherits from the final class {base}")
            for method, abstract in _methods(known[base]).items():
                if not abstract and method in _methods(node):
                    complaints.append(f"{name} overrides the concrete {base}.{method}")
    return complaints


def check_no_super(sources: list[Source]) -> list[str]:
    """No call of `super`."""
    return [
        f"{source.name}:{node.lineno} calls super"
        for source in sources
        for node in ast.walk(source.tree)
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "super"
    ]


def check_fields(sources: list[Source]) -> list[str]:
    """Fields live in final classes, and no float is static."""
    complaints = []
    for source, node in _classes(sources):
        for item in node.body:
            if not isinstance(item, ast.AnnAssign):
                continue
            field = f"{source.name}.{node.name}.{ast.unparse(item.target)}"
            annotation = ast.unparse(item.annotation)
            if _is_abstract(node.name) and "Abstract" not in annotation:
                complaints.append(f"{field} is a field of an abstract class")
            is_static = item.value is not None and "static=True" in ast.unparse(
                item.value
            )
            if is_static and re.search(r"\bfloat\b", annotation):
                complaints.append(f"{field} is a static float")
    return complaints


# ---------------------------------------------------------------------------- modules


def check_length(sources: list[Source]) -> list[str]:
    """No module is longer than `LONGEST` lines."""
    lengths = {source.name: len(source.text.splitlines()) for source in sources}
    return [
        f"{name} has {length} lines, more than {LONGEST}"
        for name, length in lengths.items()
        if length > LONGEST
    ]


def check_configuration(sources: list[Source]) -> list[str]:
    """Only the command line changes the configuration of JAX."""
    complaints = []
    for source in sources:
        if source.layer == "cli":
            continue
        bare = "jax.config" in _imported(source)
        configuration = re.compile(r"(jax\.)?config\." if bare else r"jax\.config\.")
        for node in ast.walk(source.tree):
            targets = []
            if isinstance(node, ast.Call):
                targets = [ast.unparse(node.func)]
            elif isinstance(node, ast.Assign):
                targets = [ast.unparse(target) for target in node.targets]
            for target in targets:
                if configuration.match(target):
                    complaints.append(f"{source.name}:{node.lineno} sets {target}")
    return complaints


def check_docstrings(sources: list[Source]) -> list[str]:
    """Every module, public class and public function of a module has a docstring."""
    complaints = []
    for source in sources:
        tree = source.tree
        if ast.get_docstring(tree) is None:
            complaints.append(f"{source.name} has no docstring")
        for node in tree.body:
            if not isinstance(node, ast.FunctionDef | ast.ClassDef):
                continue
            if not node.name.startswith("_") and ast.get_docstring(node) is None:
                complaints.append(f"{source.name}.{node.name} has no docstring")
    return complaints


# ------------------------------------------------------------------------------- keys

KEY = re.compile(r"[A-Z][A-Za-z]+\d{4}[a-z]?")
LOCATED = re.compile(
    r"(?<![\w\])])\[([A-Z]\w{3,})\],? (?=\(|eq\.|sec\.|ch\.|Tab|Fig|p\.)"
)


def cited_keys(text: str) -> set[str]:
    """Keys in brackets: those with a year, and others before an equation or page."""
    keys = set(LOCATED.findall(text))
    for group in re.findall(r"(?<![\w\])])\[([^\[\]\n]+)\]", text):
        parts = [part.strip() for part in re.split("[,;]", group)]
        if all(KEY.fullmatch(part) for part in parts):
            keys.update(parts)
    return keys


def bibliography_keys(text: str) -> list[str]:
    """Keys of the entries of a BibTeX file, in order."""
    return re.findall(r"^@\w+\{([^,\s]+),", text, flags=re.MULTILINE)


def check_keys(texts: dict[str, str], bibliography: str) -> list[str]:
    """Every cited key has one entry."""
    known = bibliography_keys(bibliography)
    complaints = [f"{key} has two entries" for key in known if known.count(key) > 1]
    for name, text in texts.items():
        for key in sorted(cited_keys(text) - set(known)):
            complaints.append(f"{name} cites [{key}], which has no entry")
    return complaints


# ------------------------------------------------------------------------------ tests

CHECKS = (
    check_import_stack,
    check_import_style,
    check_abstract_or_final,
    check_no_super,
    check_fields,
    check_length,
    check_configuration,
    check_docstrings,
)


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
def test_package_keeps_the_rule(check):
    complaints = check(_sources())
    assert not complaints, "\n".join(complaints)


def test_cited_keys_resolve():
    texts = {
        str(path.relative_to(ROOT)): path.read_text(encoding="utf-8")
        for folder in ("elastax", "papers")
        for path in sorted((ROOT / folder).rglob("*"))
        if path.suffix in (".py", ".md")
    }
    bibliography = (ROOT / "papers" / "references.bib").read_text(encoding="utf-8")
    complaints = check_keys(texts, bibliography)
    assert not complaints, "\n".join(complaints)


GOOD = '''
"""A module."""

import abc

import equinox as eqx

from elastax._checks import check_fields
from elastax.kinematics import SerialChain
from .._custom_types import Scalar


class AbstractLaw(eqx.Module):
    """A law."""

    order: eqx.AbstractVar[int]

    @abc.abstractmethod
    def torque(self, x): ...

    def twice(self, x):
        return 2 * self.torque(x)


class Law(AbstractLaw):
    """Its variant."""

    order: int = eqx.field(static=True)
    slope: Scalar

    def torque(self, x):
        config = {}
        config.update(x=x)
        return self.slope * x


def public():
    """It does."""


def _private(): ...
'''

BAD = [
    (check_import_stack, "from elastax.inverse import ASIM", "higher"),
    (check_import_stack, "from ..cli import main", "higher"),
    (check_import_stack, "def f():\n    import elastax.robots", "higher"),
    (check_import_stack, "from .. import plotting", "higher"),
    (check_import_stack, "from elastax import SerialChain", "top level"),
    (check_import_style, "from numpy import *", "numpy.*"),
    (check_import_style, "from __future__ import annotations", "postpones"),
    (check_import_style, "from typing import TYPE_CHECKING", "TYPE_CHECKING"),
    (check_import_style, "import matplotlib.pyplot as plt", "matplotlib"),
    (check_abstract_or_final, "class AbstractLaw: ...", "no abstractmethod"),
    (
        check_abstract_or_final,
        "class Law:\n    @abc.abstractmethod\n    def f(self): ...",
        "must start with Abstract",
    ),
    (check_abstract_or_final, "class A: ...\nclass B(A): ...", "final class A"),
    (check_abstract_or_final, "class A: ...\nclass B(m.A[int]): ...", "final class A"),
    (
        check_abstract_or_final,
        "class AbstractA:\n  def f(s): ...\nclass B(AbstractA):\n  def f(s): ...",
        "overrides the concrete AbstractA.f",
    ),
    (check_no_super, "class A:\n    def f(self): super().f()", "calls super"),
    (check_fields, "class AbstractA:\n    x: Scalar", "field of an abstract class"),
    (check_fields, "class A:\n    x: float = field(static=True)", "static float"),
    (check_length, "\n" * (LONGEST + 1), "501 lines"),
    (check_configuration, "jax.config.update('jax_enable_x64', True)", "config.update"),
    (check_configuration, "jax.config.jax_enable_x64 = True", "jax_enable_x64"),
    (check_configuration, "from jax import config\nconfig.update('x', 1)", "update"),
    (check_docstrings, "x = 1", "module has no docstring"),
    (check_docstrings, '"""M."""\ndef f(): ...', "f has no docstring"),
    (check_docstrings, '"""M."""\nclass A: ...', "A has no docstring"),
]


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
def test_rule_accepts_good_source(check):
    assert check([Source("elastax.dynamics.module", GOOD)]) == []


@pytest.mark.parametrize(("check", "text", "complaint"), BAD)
def test_rule_refuses_bad_source(check, text, complaint):
    complaints = check([Source("elastax.dynamics.module", text)])
    assert any(complaint in line for line in complaints), complaints


def test_stack_knows_every_layer():
    bad = Source("elastax.utils", "")
    assert check_import_stack([bad]) == ["elastax.utils has no place in the stack"]
    top = Source("elastax", "from .inverse import ASIM as ASIM", is_package=True)
    assert check_import_stack([top]) == []
    package = Source("elastax.io", "from ._urdf import read", is_package=True)
    assert check_import_stack([package]) == []
    private = Source("elastax._judge", "from .dynamics import simulate")
    assert len(check_import_stack([private])) == 1


def test_command_line_may_configure():
    text = "jax.config.update('jax_enable_x64', True)"
    assert check_configuration([Source("elastax.cli", text)]) == []


def test_keys_are_found():
    text = "as in [Abc2001] (2.9), [Def1999a; Ghi2010], [Name] (3-1), x[Array2000], [k]"
    assert cited_keys(text) == {"Abc2001", "Def1999a", "Ghi2010", "Name"}
    entries = "@book{Abc2001,\n}\n@misc{Name,\n}\n@misc{Name,\n}\n"
    complaints = check_keys({"file": text}, entries)
    assert "Name has two entries" in complaints
    assert "file cites [Ghi2010], which has no entry" in complaints
    assert not any("[Abc2001]" in line for line in complaints)


def test_settings_are_on():
    assert jnp.zeros(()).dtype == jnp.float64
    with pytest.raises(jaxtyping.TypeCheckError):
        check_values(3, jnp.ones(()), True)
    with pytest.raises(ValueError, match="rank_promotion"):
        jnp.ones((2, 2)) + jnp.ones(2)
