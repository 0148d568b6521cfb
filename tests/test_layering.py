"""The house's directions: app → sims → gearsig; figures and Streamlit stay in their rooms; start-up stays light."""

import ast
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).parents[1]
FILES = [p for room in ("gearsig", "sims", "app") for p in sorted((ROOT / room).rglob("*.py"))]

CHAIN = (
    "rig",
    "recording",
    "angle",
    "spectra",
    "orders",
    "timefreq",
    "decompose",
    "phase",
    "indicators",
    "motion",
    "severity",
    "diagnosis",
    "compare",
    "gap",
    "plot",
    "report",
)
"""Rooms of gearsig; each may import from rooms to its left. Plot draws what the rooms before it compute."""


def imported_modules(path: Path) -> set[str]:
    """Return all modules that a file imports, also inside functions."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.add(node.module)
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def name_of(path: Path) -> str:
    return str(path.relative_to(ROOT))


def starts_with(modules: set[str], *prefixes: str) -> set[str]:
    return {m for m in modules if any(m == p or m.startswith(p + ".") for p in prefixes)}


def offences(wrong: Callable[[str, set[str]], set[str]]) -> dict[str, set[str]]:
    """Return what `wrong` finds among each file's imports, by file."""
    found = {name_of(p): wrong(name_of(p), imported_modules(p)) for p in FILES}
    return {name: modules for name, modules in found.items() if modules}


def test_the_library_knows_no_simulator_and_no_app() -> None:
    assert not offences(lambda name, m: starts_with(m, "sims", "app") if name.startswith("gearsig/") else set())


def test_simulators_use_only_rig_recording_and_the_protocol_of_the_gap_diagnosis() -> None:
    basic = ("gearsig.checks", "gearsig.errors", "gearsig.cache", "gearsig.processes")
    allowed = ("gearsig.rig", "gearsig.recording", "gearsig.gap.simulator", *basic)

    def wrong(name: str, modules: set[str]) -> set[str]:
        if not name.startswith("sims/"):
            return set()
        return starts_with(modules, "app") | (
            starts_with(modules, "gearsig") - starts_with(modules, *allowed) - {"gearsig"}
        )

    assert not offences(wrong)


def test_blind_drives_are_for_the_benchmark_alone() -> None:
    """Neither the diagnosing simulator nor the diagnosis knows them, and they know nothing of it."""
    blind = "sims.blind_drive"
    own = ("gearsig.rig", "gearsig.recording", "gearsig.checks", "gearsig.errors", blind)

    def wrong(name: str, modules: set[str]) -> set[str]:
        if name.startswith("sims/blind_drive/"):
            return starts_with(modules, "sims", "gearsig", "app") - starts_with(modules, *own) - {"gearsig"}
        return set() if name.startswith("app/benchmark/") else starts_with(modules, blind)

    assert not offences(wrong)


def test_figures_and_streamlit_stay_in_their_rooms() -> None:
    drawing = ("gearsig/plot/", "app/")
    assert not offences(lambda n, m: set() if n.startswith(drawing) else starts_with(m, "matplotlib", "plotly"))
    assert not offences(lambda n, m: set() if n.startswith("app/") else starts_with(m, "streamlit"))


def test_rooms_of_the_chain_look_back_only() -> None:
    def wrong(name: str, modules: set[str]) -> set[str]:
        room = name.split("/")[1]
        if not name.startswith("gearsig/") or room not in CHAIN:
            return set()
        return starts_with(modules, *(f"gearsig.{later}" for later in CHAIN[CHAIN.index(room) + 1 :]))

    assert not offences(wrong)


def test_files_stay_small() -> None:
    long = {name_of(p): n for p in FILES if (n := len(p.read_text(encoding="utf-8").splitlines())) > 400}
    assert not long


def test_start_up_is_light() -> None:
    """`import gearsig` loads none of the heavy libraries; they load when they are used."""
    heavy = ("scipy", "pandas", "matplotlib", "numba", "h5py", "pyarrow", "streamlit", "plotly")
    code = f"import gearsig, sys; print([m for m in {heavy!r} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
