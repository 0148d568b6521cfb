"""The blind room shares nothing with the simulators of the diagnosing side."""

import ast
from pathlib import Path

ROOT = Path(__file__).parents[3]
BLIND = sorted((ROOT / "sims" / "blind").rglob("*.py"))
OTHERS = sorted(
    p
    for room in ("gearsig", "sims", "app")
    for p in (ROOT / room).rglob("*.py")
    if p not in BLIND and "blind" in p.read_text(encoding="utf-8")
)
ALLOWED = ("gearsig.rig", "gearsig.recording", "gearsig.errors", "gearsig.checks", "sims.blind")


def imports(path: Path) -> set[str]:
    """Full names of all modules a file imports, inside functions too; relative imports count as such."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {f"{'.' * node.level}{node.module or ''}.{alias.name}" for alias in node.names}
    return found


def within(module: str, *rooms: str) -> bool:
    return any(module == room or module.startswith(room + ".") for room in rooms)


def test_there_is_something_to_test() -> None:
    assert len(BLIND) > 4
    assert any("sims.blind._march.march" in imports(p) for p in BLIND)


def test_the_blind_room_imports_nothing_else_of_the_house() -> None:
    wrong = {
        str(p.relative_to(ROOT)): bad
        for p in BLIND
        if (bad := {m for m in imports(p) if within(m, "gearsig", "sims", "app", "tests") and not within(m, *ALLOWED)})
    }
    assert not wrong
    assert not {m for p in BLIND for m in imports(p) if m.startswith(".")}


def test_nothing_is_imported_by_its_name_as_text() -> None:
    assert not [p.name for p in BLIND if "import_module" in p.read_text(encoding="utf-8")]


def test_the_library_and_the_simulators_do_not_know_the_blind_room() -> None:
    """Only the application's benchmark may make cases: gearsig and the other simulators never look in."""
    users = {p.relative_to(ROOT).parts[0] for p in OTHERS if any(within(m, "sims.blind") for m in imports(p))}
    assert users <= {"app"}


def test_only_the_interface_is_used_outside() -> None:
    """Whoever makes cases takes names from the package itself, none of its files."""
    for path in OTHERS:
        for module in imports(path):
            if within(module, "sims.blind"):
                assert module.count(".") <= 2
                assert not module.startswith("sims.blind._")
