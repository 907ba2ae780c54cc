"""Excerpts of this package's modules: single definitions, without the libraries that the modules import.

``excerpt("warp_torchrl.world.law.fire", "Fire")`` is the class of that file, made by its own statement alone. What the
statement names is defined in the same way when it is used: names of this package by their statements, those of the
standard library by an import. Names of other libraries, and tables that other modules fill, have stand-ins, which may
stand in an annotation; whatever uses one raises ``OutOfReachError``. So the rules of dataclasses can be checked within
milliseconds, where an import of torch takes seconds.
"""

import ast
import builtins
import sys
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

PACKAGE = Path(__file__).parents[1]
_BY_NAME = ("importlib", "pkgutil")  # import what no statement shows


class OutOfReachError(Exception):
    """The use of a name that no excerpt has."""


def excerpt(module: str, name: str) -> Any:
    """Return what a module of this package defines by a name; a module that is imported already is taken as it is.

    Raises:
        OutOfReachError: If there is no such name, or its statement uses a stand-in.
    """
    if module not in sys.modules:
        return _names(module)[name]
    if not hasattr(sys.modules[module], name):
        raise OutOfReachError(f"{name} of {module}")
    return getattr(sys.modules[module], name)


def is_stand_in(value: object) -> bool:
    """Return whether a value stands in for what no excerpt has."""
    return type(value) is _StandIn


class _StandIn(type):
    """The type of stand-ins. They are classes, as annotations take no other objects."""

    def __new__(cls, name: str, bases: tuple[type, ...] = (), space: dict[str, Any] | None = None) -> "_StandIn":
        if bases:
            raise OutOfReachError(f"a class of {bases[0].__name__}")
        return super().__new__(cls, name, (), space or {})

    def __init__(cls, name: str, bases: tuple[type, ...] = (), space: dict[str, Any] | None = None) -> None:
        super().__init__(name, bases, space or {})

    def __getattr__(cls, name: str) -> "_StandIn":
        if name.startswith("__"):
            raise AttributeError(name)
        return _StandIn(f"{cls.__name__}.{name}")

    def __eq__(cls, other: object) -> bool:
        if other is None or isinstance(other, type):
            return cls is other  # typing asks
        raise OutOfReachError(cls.__name__)

    __hash__ = type.__hash__

    def _refuse(cls, *arguments: Any, **named: Any) -> Any:
        raise OutOfReachError(cls.__name__)

    __call__ = __iter__ = __len__ = __contains__ = __getitem__ = __setitem__ = __instancecheck__ = _refuse


@cache
def _names(module: str) -> "_Names":
    return _Names(module)


class _Names(dict[str, Any]):
    """The names of a module, each defined when it is first used.

    It is the ``__globals__`` of the functions that it defines: Python looks their names up by ``__missing__``.
    """

    def __init__(self, module: str) -> None:
        path = PACKAGE.joinpath(*module.split(".")[1:])
        self._path = path.with_suffix(".py") if path.with_suffix(".py").is_file() else path / "__init__.py"
        if not self._path.is_file():
            raise OutOfReachError(module)
        self._statements: dict[str, ast.stmt] = {}
        for statement in ast.parse(self._path.read_bytes()).body:
            self._statements |= dict.fromkeys(_defined(statement), statement)
        super().__init__(__name__=module, _import=_StandIn("import"))

    def __missing__(self, name: str) -> Any:
        statement = self._statements.get(name)
        if statement is None:
            if hasattr(builtins, name):
                raise KeyError(name)  # Python looks there next
            raise OutOfReachError(f"{name} of {self['__name__']}")
        if isinstance(statement, ast.Import | ast.ImportFrom):
            self[name] = _imported(statement, name)
        else:
            self._define(statement)
            value = self[name]
            if isinstance(value, dict | list | set) and not (name.startswith("_") and value):
                self[name] = _StandIn(name)  # a table, which other modules fill
        return self[name]

    def _define(self, statement: ast.stmt) -> None:
        bare = _Bare().visit(statement)
        try:
            for node in _executed(bare):
                if isinstance(node, ast.Name) and node.id in self._statements and node.id not in _defined(statement):
                    _ = self[node.id]  # the body of a class does not look names up by ``__missing__``
            exec(compile(ast.Module([bare], []), str(self._path), "exec"), self)
        except OutOfReachError:
            if isinstance(statement, ast.ClassDef | ast.FunctionDef):
                raise
            self.update({name: _StandIn(name) for name in _defined(statement)})


def _defined(statement: ast.stmt) -> list[str]:
    """Return the names that a statement of a module defines."""
    if isinstance(statement, ast.Import | ast.ImportFrom):
        return [(each.asname or each.name).partition(".")[0] for each in statement.names]
    if isinstance(statement, ast.ClassDef | ast.FunctionDef):
        return [statement.name]
    targets = getattr(statement, "targets", [getattr(statement, "target", None)])
    nodes = [node for each in targets if each is not None for node in ast.walk(each)]
    return [node.id for node in nodes if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)]


def _imported(statement: ast.Import | ast.ImportFrom, name: str) -> Any:
    wanted = next(each.name for each in statement.names if (each.asname or each.name).partition(".")[0] == name)
    module = statement.module if isinstance(statement, ast.ImportFrom) else None
    root = (module or wanted).partition(".")[0]
    if root == PACKAGE.name and module:
        return excerpt(module, wanted)
    if root not in sys.stdlib_module_names or root in _BY_NAME:
        return _StandIn(name)
    return getattr(import_module(module), wanted) if module else import_module(root)


class _Bare(ast.NodeTransformer):
    """Takes off what no rule uses: annotations of functions, and decorators that enter a class into a table."""

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.FunctionDef:
        node.returns = None
        for each in ast.walk(node.args):
            if isinstance(each, ast.arg):
                each.annotation = None
        self.generic_visit(node)
        return node

    def visit_ClassDef(self, node: ast.ClassDef) -> ast.ClassDef:
        node.decorator_list = [each for each in node.decorator_list if ast.unparse(each).startswith("dataclass")]
        self.generic_visit(node)
        return node

    def visit_Import(self, node: ast.Import | ast.ImportFrom) -> ast.stmt:
        call = ast.copy_location(ast.Expr(ast.Call(ast.Name("_import", ast.Load()), [], [])), node)
        return ast.fix_missing_locations(call)  # in a function: out of reach

    visit_ImportFrom = visit_Import  # noqa: N815


def _executed(node: ast.AST) -> Iterator[ast.AST]:
    """Yield the nodes that run when a statement does: bodies of functions do not."""
    yield node
    for name, value in ast.iter_fields(node):
        if not (name == "body" and isinstance(node, ast.FunctionDef | ast.Lambda)):
            for each in value if isinstance(value, list) else [value]:
                if isinstance(each, ast.AST):
                    yield from _executed(each)
