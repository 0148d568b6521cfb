"""The house's directions: app → sims → gearsig; rooms have faces; figures and Streamlit stay where they belong."""

import ast
import subprocess
import sys
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LAYERS = ("gearsig", "sims", "app")
FILES = [p for layer in LAYERS for p in sorted((ROOT / layer).rglob("*.py"))]

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
    "prepared",
    "severity",
    "diagnosis",
    "comparison",
    "gap",
    "fleet",
    "plot",
    "methods",
    "report",
)
"""Rooms of gearsig; each may import from rooms to its left. Plot draws what the rooms before it compute."""
SIMULATORS = (
    *("measure", "mesh", "machine", "effects", "presets", "simulator", "fe_gear", "gear_pair", "cracked", "reduced_fe"),
    *("forging", "registry", "files", "sweep", "continuation"),
)
"""Those of sims, likewise."""


def name_of(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def statements(tree: ast.AST) -> Iterator[ast.AST]:
    """Yield all statements below a node, without looking into expressions, which most nodes are of."""
    for field in ("body", "orelse", "finalbody", "handlers", "cases"):
        for node in getattr(tree, field, ()):
            yield node
            yield from statements(node)


def imports_of(text: str, name: str) -> set[str]:
    """Return all modules that a file of that name imports, also inside functions, and the names it takes from them."""
    folders = name.split("/")[:-1]
    found = set()
    for node in statements(ast.parse(text)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            # One dot is the file's own folder, each further one the folder above.
            above = folders[: len(folders) + 1 - node.level] if node.level else []
            module = ".".join([*above, *([node.module] if node.module else [])])
            found |= {module} | {f"{module}.{alias.name}" for alias in node.names}
    return found


def imported_modules(path: Path) -> set[str]:
    return imports_of(path.read_text(encoding="utf-8"), name_of(path))


@cache
def imports() -> dict[str, set[str]]:
    """Return the modules that each file imports: parsed once, and not while tests are collected."""
    return {name_of(p): imported_modules(p) for p in FILES}


def starts_with(modules: set[str], *prefixes: str) -> set[str]:
    return {m for m in modules if any(m == p or m.startswith(p + ".") for p in prefixes)}


def offences(wrong: Callable[[str, set[str]], set[str]]) -> dict[str, set[str]]:
    """Return what `wrong` finds among each file's imports, by file."""
    found = {name: wrong(name, modules) for name, modules in imports().items()}
    return {name: modules for name, modules in found.items() if modules}


def is_private(module: str) -> bool:
    """Whether a part of a dotted name, its last one as well, has a leading underscore."""
    return any(part.startswith("_") and not part.startswith("__") for part in module.split("."))


def entered_past_the_face(name: str, modules: set[str]) -> set[str]:
    """Return what a file imports of other rooms' private modules and names."""
    own = ".".join(name.removesuffix(".py").split("/")[:2])
    return {m for m in starts_with(modules, *LAYERS) if is_private(m) and not m.startswith(own + ".")}


def test_the_library_knows_no_simulator_and_no_app() -> None:
    assert not offences(lambda name, m: starts_with(m, "sims", "app") if name.startswith("gearsig/") else set())


def test_simulators_use_only_rig_recording_and_the_protocol_of_the_gap_diagnosis() -> None:
    basic = (
        "gearsig.checks",
        "gearsig.results",
        "gearsig.errors",
        "gearsig.cache",
        "gearsig.compiled",
        "gearsig.processes",
        "gearsig.formatting",
    )
    drive = {"DriveFacts", "DriveSimulator", "DriveTwin"}
    protocol = {"AddedEffect", "GapEffect", "GapSimulator", "OperatingCondition", "Twin"} | drive
    allowed = ("gearsig.rig", "gearsig.recording", *basic, *(f"gearsig.gap.{name}" for name in protocol))

    def wrong(name: str, modules: set[str]) -> set[str]:
        if not name.startswith("sims/"):
            return set()
        return starts_with(modules, "app") | (
            starts_with(modules, "gearsig") - starts_with(modules, *allowed) - {"gearsig", "gearsig.gap"}
        )

    assert not offences(wrong)


def test_blind_drives_are_for_benchmark_and_studies_alone() -> None:
    """Neither the diagnosing simulator nor the diagnosis knows them, and they know nothing of it."""
    blind = "sims.blind_drive"
    own = ("gearsig.rig", "gearsig.recording", "gearsig.checks", "gearsig.errors", blind)

    def wrong(name: str, modules: set[str]) -> set[str]:
        if name == "sims/blind_drive.py":
            return starts_with(modules, "sims", "gearsig", "app") - starts_with(modules, *own) - {"gearsig"}
        return set() if name.startswith(("app/benchmark/", "app/studies/")) else starts_with(modules, blind)

    assert not offences(wrong)


def test_figures_and_streamlit_stay_in_their_rooms() -> None:
    drawing = ("gearsig/plot/", "app/")
    assert not offences(lambda n, m: set() if n.startswith(drawing) else starts_with(m, "matplotlib", "plotly"))
    pages = ("app/dashboard/", "app/cli/dashboard.py")
    assert not offences(lambda n, m: set() if n.startswith(pages) else starts_with(m, "streamlit"))


@pytest.mark.parametrize(("layer", "chain"), [("gearsig", CHAIN), ("sims", SIMULATORS)])
def test_rooms_of_the_chain_look_back_only(layer: str, chain: tuple[str, ...]) -> None:
    def wrong(name: str, modules: set[str]) -> set[str]:
        room = name.split("/")[1].removesuffix(".py")
        if not name.startswith(f"{layer}/") or room not in chain:
            return set()
        types = {"sims.simulator", "sims.simulator.ParameterValue"} if room == "presets" else set()  # a name of a type
        return starts_with(modules, *(f"{layer}.{later}" for later in chain[chain.index(room) + 1 :])) - types

    assert not offences(wrong)


def test_rooms_are_entered_by_their_faces() -> None:
    assert not offences(entered_past_the_face)


@pytest.mark.parametrize(
    "line",
    [
        "import gearsig.orders._average",
        "import gearsig.orders._average as average",
        "from gearsig.orders import _average",
        "from gearsig.orders import _average as average",
        "from gearsig.orders._average import synchronous_average",
        "from gearsig.orders.vold_kalman._joint import solve_band",
        "from gearsig.batch import _failure",
        "from ..orders import _average",
        "from ..orders._average import synchronous_average",
        "from .. import orders, _private",
        "def f():\n    from gearsig.orders import _average",
    ],
)
def test_no_spelling_gets_past_a_face(line: str) -> None:
    name = "gearsig/spectra/_types.py"
    assert entered_past_the_face(name, imports_of(line, name))


@pytest.mark.parametrize(
    "line",
    [
        "from gearsig.orders import synchronous_average",
        "from ..orders import synchronous_average",
        "import gearsig.orders",
        "from gearsig import __version__",
        "from gearsig.spectra import _types",
        "from ._amplitude import amplitude_spectrum",
        "from . import _amplitude",
        "from scipy.signal import _peak_finding",
    ],
)
def test_faces_and_the_own_room_are_open(line: str) -> None:
    name = "gearsig/spectra/_types.py"
    assert not entered_past_the_face(name, imports_of(line, name))


def test_relative_imports_count_like_absolute_ones() -> None:
    text = "from . import orders\nfrom ...sims import mesh\nfrom .orders import synchronous_average"
    assert imports_of(text, "gearsig/x/__init__.py") == {
        "gearsig.x",
        "gearsig.x.orders",
        "gearsig.x.orders.synchronous_average",
        "sims",
        "sims.mesh",
    }


def test_tests_enter_rooms_by_their_faces() -> None:
    """Through no private module; a public module's private names are the one thing that a test may look at."""

    def inside(module: str) -> bool:
        through, _, _ = module.rpartition(".")
        return is_private(through) or (is_private(module) and (ROOT / f"{module.replace('.', '/')}.py").exists())

    files = sorted((ROOT / "tests").rglob("*.py"))
    assert not {name_of(p) for p in files if any(inside(m) for m in starts_with(imported_modules(p), *LAYERS))}


def test_modules_of_the_library_import_each_other_one_way() -> None:
    """Also what is imported in a function or for a type alone: in a circle something stands in the wrong file."""
    files = {name.removesuffix(".py").replace("/", "."): name for name in imports() if name.startswith("gearsig/")}
    uses = {module: {m for m in imports()[name] if m in files and m != module} for module, name in files.items()}

    def reached(module: str) -> set[str]:
        seen, ahead = set(), [*uses[module]]
        while ahead:
            if (now := ahead.pop()) not in seen:
                seen.add(now)
                ahead += uses[now]
        return seen

    assert not {module for module in files if module in reached(module)}


def test_faces_list_what_they_offer() -> None:
    bare = []
    for path in FILES:
        room = path.parent.relative_to(ROOT).parts
        if path.name == "__init__.py" and room[0] != "app" and len(room) == 2:
            names = [n.targets[0].id for n in ast.parse(path.read_text("utf-8")).body if isinstance(n, ast.Assign)]  # type: ignore[attr-defined]
            if "__all__" not in names:
                bare.append(name_of(path))
    assert not bare


def test_a_class_name_exists_once() -> None:
    places = defaultdict(list)
    for path in FILES:
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef):
                places[node.name].append(name_of(path))
    assert not {name: where for name, where in places.items() if len(where) > 1}


def test_modules_are_subjects_and_not_scraps() -> None:
    """A tenth of the modules at most are shorter than sixty lines; none is longer than 1000."""
    lengths = Counter({name_of(p): len(p.read_text("utf-8").splitlines()) for p in FILES if p.name != "__init__.py"})
    assert not {name: n for name, n in lengths.items() if n > 1000}
    effects = [name for name in lengths if name.startswith("sims/effects/")]
    short = [name for name, n in lengths.items() if n < 60 and name not in effects]
    assert len(short) <= 0.1 * len(lengths), short


@pytest.mark.parametrize("start", ["import gearsig", "import app.cli.main"])
def test_start_up_is_light(start: str) -> None:
    """The library and the command line load none of the heavy libraries before they are used."""
    heavy = ("scipy", "pandas", "matplotlib", "numba", "h5py", "pyarrow", "streamlit", "plotly", "sklearn")
    code = f"{start}, sys; print([m for m in {heavy!r} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
