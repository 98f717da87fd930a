"""Which codes of errors, refused rows and failed loops the source gives, by its syntax trees."""

import ast
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
ROOTS = {"LoopauditError", "Refusal", "ServiceError"}
"""Classes of errors with a code; those that derive from them have one too."""
SAID_ELSEWHERE = ("app/engine", "app/services/telling", "app/services/audit_json", "app/lab")
"""Rooms where what is called code is that of a reason, an effect or a step: their errors alone are looked at."""
REASONS = {"effect_words", "cause_to_ask_for", "words", "newest_naming", "naming_ids", "_naming", "EvidenceOut"}
"""What takes the code of a reason in other rooms."""
LOGS = {"add", "add_many"}
"""What takes a code where it is of a log of refused rows."""
HOLDERS = {"OddNumbers": 1}
"""What takes codes as the keys of a dict, and where."""
ANSWERERS = {"_fault"}
"""Functions of ingest that return codes."""
NAMES = {"code", "error_code"}
IN_BRACKETS = re.compile(r" \[([a-z]+(?:_[a-z]+)*)\]$")
Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True)
class Module:
    path: str
    tree: ast.Module
    constants: dict[str, ast.expr]
    owners: dict[ast.AST, Function | None] = field(repr=False)


@dataclass
class Found:
    """codes: all that are given. forwarded: what else stands where a code is to be given."""

    codes: set[str] = field(default_factory=set)
    forwarded: set[str] = field(default_factory=set)

    def note(self, code: ast.expr | None, module: Module) -> None:
        for part in parts(code, module):
            if isinstance(part, str):
                self.codes.add(part)
            elif not hands_on(part, module):
                self.forwarded.add(ast.unparse(part))


@cache
def modules() -> tuple[Module, ...]:
    files = sorted(path for room in ("app", "workers") for path in (ROOT / room).rglob("*.py"))
    trees = {path.relative_to(ROOT).as_posix(): ast.parse(path.read_text(encoding="utf-8")) for path in files}
    own = {path: dict(assigned(tree.body)) for path, tree in trees.items()}
    return tuple(Module(path, tree, {**imported(tree, own), **own[path]}, owned(tree)) for path, tree in trees.items())


def assigned(body: list[ast.stmt]) -> Iterator[tuple[str, ast.expr]]:
    for one in body:
        if isinstance(one, ast.Assign):
            yield from ((target.id, one.value) for target in one.targets if isinstance(target, ast.Name))


def imported(tree: ast.Module, own: dict[str, dict[str, ast.expr]]) -> dict[str, ast.expr]:
    found = {}
    for one in tree.body:
        if isinstance(one, ast.ImportFrom) and one.module:
            there = own.get(f"{one.module.replace('.', '/')}.py", {})
            found |= {a.asname or a.name: there[a.name] for a in one.names if a.name in there}
    return found


def owned(tree: ast.Module) -> dict[ast.AST, Function | None]:
    """Each node with the function that it stands in."""
    found: dict[ast.AST, Function | None] = {tree: None}
    left: list[ast.AST] = [tree]
    while left:
        node = left.pop()
        inside = node if isinstance(node, Function) else found[node]
        children = list(ast.iter_child_nodes(node))
        found |= dict.fromkeys(children, inside)
        left += children
    return found


def name_of(node: ast.expr) -> str:
    return node.id if isinstance(node, ast.Name) else node.attr if isinstance(node, ast.Attribute) else ""


def every(*kinds: type[ast.AST]) -> Iterator[tuple[Module, ast.AST]]:
    return ((module, node) for module in modules() for node in module.owners if isinstance(node, kinds))


@cache
def error_classes() -> frozenset[str]:
    classes = [node for _, node in every(ast.ClassDef)]
    found = set(ROOTS)
    while more := {c.name for c in classes if {name_of(base) for base in c.bases} & found} - found:
        found |= more
    return frozenset(found)


@cache
def takers() -> dict[str, int]:
    """Which argument of what is called is a code: that of the name, as errors, functions and rows of errors have it."""
    found: dict[str, int | None] = dict.fromkeys(error_classes(), 0)
    for module, node in every(ast.ClassDef, Function):
        apart = module.path.startswith(SAID_ELSEWHERE)
        if node.name in REASONS or (apart and node.name not in found):
            continue
        if isinstance(node, ast.ClassDef):
            found[node.name] = place_of_class(node, found.get(node.name))
        elif not node.name.startswith("__"):
            at = place(node.args)
            found |= {} if at is None else {node.name: at}
    return {name: at for name, at in found.items() if at is not None}


def place(arguments: ast.arguments) -> int | None:
    texts = parameters(arguments)
    return next((at for at, name in enumerate(texts) if name in NAMES and texts[name]), None)


def parameters(arguments: ast.arguments) -> dict[str, bool]:
    """Whether each is a text."""
    found = {one.arg: is_text(one.annotation) for one in (*arguments.posonlyargs, *arguments.args)}
    return {name: text for name, text in found.items() if name not in ("self", "cls")}


def is_text(annotation: ast.expr | None) -> bool:
    return annotation is not None and ast.unparse(annotation) in ("str", "str | None")


def place_of_class(made: ast.ClassDef, inherited: int | None) -> int | None:
    """By its `__init__`, else by its fields, else as in the class that it derives from."""
    init = next((one for one in made.body if isinstance(one, Function) and one.name == "__init__"), None)
    if init is not None:
        return place(init.args)
    fields = [one for one in made.body if isinstance(one, ast.AnnAssign) and isinstance(one.target, ast.Name)]
    texts = {name_of(one.target): is_text(one.annotation) for one in fields}
    return next((at for at, name in enumerate(texts) if name in NAMES and texts[name]), inherited)


def given(call: ast.Call, at: int, module: Module) -> ast.expr | None:
    """The argument in that place, or by its name."""
    arguments: list[ast.expr] = []
    for one in call.args:
        whole = module.constants.get(name_of(one.value)) if isinstance(one, ast.Starred) else None
        arguments += whole.elts if isinstance(whole, ast.Tuple) else [one]
    named = next((one.value for one in call.keywords if one.arg in NAMES), None)
    return arguments[at] if at < len(arguments) else named


def parts(code: ast.expr | None, module: Module) -> Iterator[str | ast.expr]:
    """The codes that an expression may be, and what is none of itself."""
    if code is None or (isinstance(code, ast.Constant) and code.value is None):
        return
    if isinstance(code, ast.Constant) and isinstance(code.value, str):
        yield from [code.value] if code.value else []
    elif isinstance(code, ast.IfExp):
        yield from (one for side in (code.body, code.orelse) for one in parts(side, module))
    elif isinstance(code, ast.Dict):
        yield from (one for key in code.keys for one in parts(key, module))
    elif isinstance(code, ast.Name) and code.id in module.constants:
        yield from parts(module.constants[code.id], module)
    elif isinstance(code, ast.Name) and (values := list(bound(code, module))):
        yield from (one for value in values for one in parts(value, module))
    else:
        yield code


def bound(name: ast.Name, module: Module) -> Iterator[ast.expr]:
    """What a name of a function is set to, by itself or in the place that it has among others."""
    owner = module.owners.get(name)
    for node in ast.walk(owner) if owner is not None else ():
        if isinstance(node, ast.Assign):
            yield from (value for target in node.targets for value in into(target, node.value, name.id))
        if isinstance(node, ast.For | ast.comprehension):
            yield from into(node.target, node.iter, name.id)


def into(target: ast.expr, value: ast.expr, name: str) -> Iterable[ast.expr]:
    if isinstance(target, ast.Name) and target.id == name:
        return [value]
    if not isinstance(target, ast.Tuple) or name not in [name_of(one) for one in target.elts]:
        return []
    if isinstance(value, ast.Tuple):
        return [value.elts[[name_of(one) for one in target.elts].index(name)]]
    match value:
        case ast.Call(func=ast.Attribute(value=ast.Dict() as items, attr="items")):
            return [items]
    return [value]


def hands_on(code: ast.expr, module: Module) -> bool:
    """Whether it is the code of an error, or what a function was given as one."""
    owner = module.owners.get(code)
    of_owner = (
        owner is not None
        and owner.name in {*takers(), "__init__"}
        and name_of(code) in NAMES & {*parameters(owner.args)}
    )
    return of_owner or (isinstance(code, ast.Attribute) and code.attr in NAMES)


@cache
def scanned() -> Found:
    found = Found()
    for module, call in every(ast.Call):
        note_call(call, module, found)
    for module, node in every(ast.Dict, Function, ast.Constant, ast.AnnAssign):
        note_other(node, module, found)
    for module, node in every(ast.Assign):
        if [name_of(target) for target in node.targets] == ["CODE_BY_STATUS"]:
            found.codes |= {one for value in node.value.values for one in parts(value, module) if isinstance(one, str)}
    return found


def note_call(call: ast.Call, module: Module, found: Found) -> None:
    name = name_of(call.func)
    apart = module.path.startswith(SAID_ELSEWHERE)
    if name == "__init__" and (base := base_of(call, module)):
        found.note(given(call, takers()[base], module), module)
    elif name in HOLDERS:
        found.note(call.args[HOLDERS[name]], module)
    elif name in LOGS and not of_log(call.func):
        return
    elif name in takers() and (not apart or name in error_classes()):
        found.note(given(call, takers()[name], module), module)
    elif not apart:
        found.note(next((one.value for one in call.keywords if one.arg in NAMES), None), module)


def of_log(function: ast.expr) -> bool:
    return isinstance(function, ast.Attribute) and name_of(function.value) in ("log", "_log", "self")


def base_of(call: ast.Call, module: Module) -> str | None:
    """What an error derives from that is made by this call of its `super().__init__`."""
    classes = [one for one in module.tree.body if isinstance(one, ast.ClassDef) and one.name in error_classes() - ROOTS]
    return next((name_of(one.bases[0]) for one in classes if call in ast.walk(one)), None)


def note_other(node: ast.AST, module: Module, found: Found) -> None:
    apart = module.path.startswith(SAID_ELSEWHERE)
    if isinstance(node, ast.Dict) and not apart:
        for key, value in zip(node.keys, node.values, strict=True):
            if isinstance(key, ast.Constant) and key.value in NAMES:
                found.note(value, module)
    if isinstance(node, ast.AnnAssign) and not apart and name_of(node.target) in NAMES:
        found.note(None if isinstance(node.value, ast.Call) else node.value, module)
    if isinstance(node, Function) and node.name in ANSWERERS and module.path.startswith("app/ingest"):
        for one in ast.walk(node):
            found.note(one.value if isinstance(one, ast.Return) else None, module)
    if isinstance(node, ast.Constant) and isinstance(node.value, str) and module.path.startswith("app/cli"):
        found.codes |= set(IN_BRACKETS.findall(node.value))
