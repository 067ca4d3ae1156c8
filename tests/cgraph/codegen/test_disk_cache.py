"""Machine code on disk: it is found again, only where it belongs, and never in the way."""

import errno
import multiprocessing
import os
import pickle
import stat
import subprocess
import sys
import warnings
from concurrent.futures import ThreadPoolExecutor
from operator import attrgetter, methodcaller
from pathlib import Path

import numpy as np
import pytest

import cgraph as cg
from cgraph import clear_cache
from cgraph.codegen import disk_cache as cache, llvm_engine as llvm

llvmlite = pytest.importorskip("llvmlite")
binding = pytest.importorskip("llvmlite.binding")

ROOT = Path(__file__).parents[3]
POINT = [0.3, -0.7]
POINTS = np.linspace([-2.0, 0.5], [1e7, 3.0], 37).T  # beyond the range of the polynomials, too
POSIX = pytest.mark.skipif(os.name == "nt", reason="permissions of POSIX")


def graph(constant=2.5):
    x, y = cg.variables("x y")
    return cg.Graph([x, y], {"u": cg.sin(x) * cg.exp(-y) + x * y, "v": cg.atan2(x, y) * constant + x})


def bits(function):
    """The values at one point and at many, to the last bit."""
    return function(POINT).tobytes(), function.batch(POINTS).tobytes()


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "kept"


@pytest.fixture
def translations(monkeypatch):
    """A list that grows with every translation to machine code."""
    seen, real = [], binding.TargetMachine.emit_object

    def emit(machine, module):
        seen.append(str(module))
        return real(machine, module)

    monkeypatch.setattr(binding.TargetMachine, "emit_object", emit)
    return seen


def entries(folder):
    return sorted(folder.glob(f"*{cache.SUFFIX}"))


def test_the_second_compilation_translates_nothing_and_has_the_same_values(folder, translations):
    plain = bits(cg.compile(graph(), "llvm"))
    del translations[:]
    first = bits(cg.compile(graph(), "llvm", cache=folder))
    assert len(translations) == len(entries(folder)) == 2  # for a point, for batches
    second = bits(cg.compile(graph(), "llvm", cache=folder))
    assert len(translations) == 2
    assert first == second == plain


def test_without_the_option_nothing_is_written(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    bits(cg.compile(graph(), "llvm"))
    assert list(tmp_path.iterdir()) == []


def test_names_and_tags_do_not_matter(folder, translations):
    cg.compile(graph(), "llvm", cache=folder)
    with cg.tag("link 1"):
        a, b = cg.variables("a b")
        again = cg.Graph([a, b], {"first": cg.sin(a) * cg.exp(-b) + a * b, "second": cg.atan2(a, b) * 2.5 + a})
    assert bits(cg.compile(again, "llvm", cache=folder)) == bits(cg.compile(graph(), "llvm"))
    assert len(entries(folder)) == 2


def compile_for_other_lanes(folder, monkeypatch):
    monkeypatch.setattr(llvm.host(), "lanes", 4 if llvm.host().lanes == 2 else 2)
    cg.compile(graph(), "llvm", cache=folder).batch(POINTS)


def compile_on_a_host(change):
    """Compilation where LLVM says something else about itself or the processor."""

    def compile(folder, monkeypatch):
        version = change(monkeypatch) or llvmlite.__version__
        other = llvm.Host(binding, version)
        monkeypatch.setattr(llvm, "host", lambda: other)
        cg.compile(graph(), "llvm", cache=folder).batch(POINTS)

    return compile


def fewer_features(monkeypatch):
    features = binding.get_host_cpu_features()
    features["fma"] = not features.get("fma", False)
    monkeypatch.setattr(binding, "get_host_cpu_features", lambda: features)


def compile_with(graph, **options):
    return lambda folder, _: cg.compile(graph, "llvm", cache=folder, **options).batch(POINTS)


OTHERS = {
    "fma": compile_with(graph(), fma=False),
    "fast": compile_with(graph(), fast=True),
    "a constant's last bit": compile_with(graph(np.nextafter(2.5, 3.0))),
    "lanes": compile_for_other_lanes,
    "processor": compile_on_a_host(lambda patch: patch.setattr(binding, "get_host_cpu_name", lambda: "generic")),
    "features": compile_on_a_host(fewer_features),
    "LLVM": compile_on_a_host(lambda patch: patch.setattr(binding, "llvm_version_info", (99, 0, 0))),
    "llvmlite": compile_on_a_host(lambda _: "99.0"),
    "optimisation": compile_on_a_host(lambda patch: patch.setattr(llvm, "LEVEL", 0)),
}


@pytest.mark.parametrize("what", OTHERS)
def test_other_code_has_other_entries(what, folder, monkeypatch):
    cg.compile(graph(), "llvm", cache=folder).batch(POINTS)
    before = {path: path.read_bytes() for path in entries(folder)}
    OTHERS[what](folder, monkeypatch)
    assert len(entries(folder)) >= (3 if what == "lanes" else 4)  # the code for a point need not know the lanes
    assert all(path.read_bytes() == content for path, content in before.items())


def test_the_sign_of_a_zero_is_another_constant(folder):
    x = cg.variable("x")
    values = [cg.compile(cg.Graph([x], {"y": x * zero}), "llvm", cache=folder)([1.0])[0] for zero in (0.0, -0.0)]
    assert np.signbit(values).tolist() == [False, True]


def flipped(position):
    def damage(content):
        changed = bytearray(content)
        changed[position] ^= 0x10
        return bytes(changed)

    return damage


DAMAGE = {
    "checksum": flipped(5),
    "first byte": flipped(32),
    "middle": flipped(700),
    "last byte": flipped(-1),
    "short": lambda content: content[:-1],
    "half": lambda content: content[: len(content) // 2],
    "checksum alone": lambda content: content[:32],
    "part of a checksum": lambda content: content[:7],
    "empty": lambda _: b"",
    "long": lambda content: content + b"\0",
    "garbage": lambda _: bytes(range(256)) * 9,
    "zeros": lambda content: bytes(len(content)),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_a_damaged_entry_is_made_anew_and_never_shown_to_llvm(damage, folder, translations, monkeypatch):
    expected = cg.compile(graph(), "llvm", cache=folder)(POINT)
    (path,) = entries(folder)
    good = path.read_bytes()
    path.write_bytes(DAMAGE[damage](good))

    def load(content, real=binding.ObjectFileRef.from_data):
        assert content == good[32:]
        return real(content)

    monkeypatch.setattr(binding.ObjectFileRef, "from_data", load)
    assert np.array_equal(cg.compile(graph(), "llvm", cache=folder)(POINT), expected)
    assert np.array_equal(cg.compile(graph(), "llvm", cache=folder)(POINT), expected)
    assert len(translations) == 2  # the first and the one after the damage
    assert path.read_bytes() == good


def test_an_entry_under_another_name_is_not_believed(folder):
    cg.compile(graph(), "llvm", cache=folder)
    (one,) = entries(folder)
    expected = cg.compile(graph(7.0), "llvm", cache=folder)(POINT)
    (other,) = set(entries(folder)) - {one}
    other.write_bytes(one.read_bytes())
    assert np.array_equal(cg.compile(graph(7.0), "llvm", cache=folder)(POINT), expected)


@POSIX
def test_the_folder_and_its_entries_are_the_owners_alone(folder):
    old = os.umask(0)
    try:
        cg.compile(graph(), "llvm", cache=folder)
    finally:
        os.umask(old)
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert [stat.S_IMODE(path.stat().st_mode) for path in entries(folder)] == [0o600]


@POSIX
@pytest.mark.parametrize("mode", [0o620, 0o602])
def test_an_entry_that_others_could_write_is_not_believed(mode, folder, translations):
    cg.compile(graph(), "llvm", cache=folder)
    (path,) = entries(folder)
    path.chmod(mode)
    cg.compile(graph(), "llvm", cache=folder)
    assert len(translations) == 2
    assert stat.S_IMODE(path.stat().st_mode) == 0o600


@POSIX
def test_an_entry_of_another_user_is_not_believed(folder, translations, monkeypatch):
    cg.compile(graph(), "llvm", cache=folder)
    (path,) = entries(folder)
    theirs, real = path.stat().st_ino, os.fstat

    def fstat(file):
        status = real(file)
        return os.stat_result((*status[:4], 12345, *status[5:])) if status.st_ino == theirs else status

    monkeypatch.setattr(os, "fstat", fstat)
    for _ in range(2):
        cg.compile(graph(), "llvm", cache=folder)
    assert len(translations) == 2  # ours has taken the place of theirs


def test_a_file_in_place_of_the_folder_is_a_warning(folder):
    folder.write_text("mine")
    with pytest.warns(RuntimeWarning, match=r"machine code is not kept in .*kept: File exists|Not a directory"):
        function = cg.compile(graph(), "llvm", cache=folder)
    assert np.array_equal(function(POINT), cg.compile(graph(), "llvm")(POINT))
    assert folder.read_text() == "mine"


def test_a_folder_in_place_of_an_entry_is_a_warning(folder):
    cg.compile(graph(), "llvm", cache=folder)
    (path,) = entries(folder)
    path.unlink()
    path.mkdir()
    with pytest.warns(RuntimeWarning, match="not kept"):
        cg.compile(graph(), "llvm", cache=folder)
    assert list(folder.iterdir()) == [path]


@POSIX
@pytest.mark.parametrize("what", ["pipe", "device", "huge file"])
def test_what_is_no_entry_is_neither_waited_for_nor_read(what, folder, translations):
    cg.compile(graph(), "llvm", cache=folder)
    (path,) = entries(folder)
    path.unlink()
    if what == "pipe":
        os.mkfifo(path, 0o600)  # nobody will write to it
    elif what == "device":
        path.symlink_to("/dev/zero")  # without an end
    else:
        path.touch(0o600)
        os.truncate(path, 2**36)  # sparse: it takes no space
    cg.compile(graph(), "llvm", cache=folder)
    assert len(translations) == 2
    assert path.is_file()
    assert not path.is_symlink()  # an entry has taken its place


def test_a_full_disk_is_a_warning_and_leaves_nothing_behind(folder, monkeypatch):
    def replace(path, target):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))

    monkeypatch.setattr(Path, "replace", replace)
    with pytest.warns(RuntimeWarning, match="No space left"):
        function = cg.compile(graph(), "llvm", cache=folder)
    assert np.array_equal(function(POINT), cg.compile(graph(), "llvm")(POINT))
    assert list(folder.iterdir()) == []


def test_a_folder_that_cannot_be_written_still_gives_what_it_has(folder, translations, monkeypatch):
    cg.compile(graph(), "llvm", cache=folder)

    real = os.open

    def read_only(path, flags, *mode):
        if flags & os.O_CREAT:
            raise OSError(errno.EROFS, os.strerror(errno.EROFS))
        return real(path, flags, *mode)

    monkeypatch.setattr(os, "open", read_only)
    cg.compile(graph(), "llvm", cache=folder)  # and no warning, which would be an error here
    assert len(translations) == 1
    with pytest.warns(RuntimeWarning, match="Read-only"):
        cg.compile(graph(7.0), "llvm", cache=folder)


def test_a_user_without_a_home_gets_a_warning(monkeypatch):
    def home(_):
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.delenv("LOCALAPPDATA", raising=False)
    monkeypatch.setattr(Path, "home", classmethod(home))
    with pytest.warns(RuntimeWarning, match="home"):
        assert cg.compile(graph(), "llvm", cache=True).batch(POINTS).shape == (2, 37)


WORKER = """
import sys
import cgraph as cg
from tests.cgraph.codegen.test_disk_cache import bits, graph
graphs = [graph(constant) for constant in (1.0, 2.0, 3.0)]
print("ready", flush=True)
sys.stdin.readline()
for each in graphs:
    print(*[values.hex() for values in bits(cg.compile(each, "llvm", cache=sys.argv[1]))])
"""


def test_processes_may_fill_one_folder_at_once(folder):
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True, "cwd": ROOT}
    command = [sys.executable, "-W", "error", "-c", WORKER, str(folder)]
    workers = [subprocess.Popen(command, **pipes) for _ in range(2)]
    for worker in workers:
        assert worker.stdout.readline() == "ready\n"
    for worker in workers:
        worker.stdin.write("go\n")
        worker.stdin.flush()
    printed = {worker.communicate()[0] for worker in workers}
    plain = [bits(cg.compile(graph(constant), "llvm")) for constant in (1.0, 2.0, 3.0)]
    assert printed == {"".join(f"{point.hex()} {batch.hex()}\n" for point, batch in plain)}
    assert len(entries(folder)) == len(list(folder.iterdir())) == 6


def test_threads_may_fill_one_folder_at_once(folder):
    with ThreadPoolExecutor(8) as pool:
        found = set(pool.map(lambda _: bits(cg.compile(graph(), "llvm", cache=folder)), range(16)))
    assert found == {bits(cg.compile(graph(), "llvm"))}
    assert len(entries(folder)) == len(list(folder.iterdir())) == 2


def test_a_function_of_libm_that_is_missing_is_an_error_even_with_the_code_at_hand(folder, monkeypatch):
    cg.compile(graph(), "llvm", cache=folder)
    monkeypatch.setattr(binding, "address_of_symbol", lambda name: None if name == "atan2" else 1)
    with pytest.raises(RuntimeError, match="has no atan2"):
        cg.compile(graph(), "llvm", cache=folder)


@pytest.mark.parametrize("backend", ["llvm", "auto", "numpy"])
def test_a_pickle_keeps_the_choice(backend, folder):
    options = {"cache": str(folder), "fast": True, "fma": False}
    function = cg.compile(graph(), backend, **options)
    restored = pickle.loads(pickle.dumps(function))
    assert restored.options == function.options == options
    assert bits(restored) == bits(function)


def test_another_process_reads_what_this_one_compiled(folder):
    function = cg.compile(graph(), "llvm", cache=folder, fma=False)
    (path,) = entries(folder)
    written = path.stat().st_mtime_ns, path.stat().st_ino
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert pool.map(methodcaller("values", POINT), [function]) == [function.values(POINT)]
        assert pool.map(attrgetter("options"), [function]) == [function.options]
        (batch,) = pool.map(methodcaller("batch", POINTS, threads=2), [function])
    assert np.array_equal(batch, function.batch(POINTS))
    assert (path.stat().st_mtime_ns, path.stat().st_ino) == written


def test_a_relative_path_means_the_folder_it_meant(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    function = cg.compile(graph(), "llvm", cache="here")
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    function.batch(POINTS)
    pickle.loads(pickle.dumps(function))
    assert len(entries(tmp_path / "here")) == 2
    assert list((tmp_path / "elsewhere").iterdir()) == []


@pytest.mark.parametrize("choice", [None, 3, "", b"folder", 1.0])
@pytest.mark.parametrize("backend", ["llvm", "python"])
def test_any_other_choice_is_an_error(choice, backend):
    with pytest.raises(TypeError, match="cache must be True, False or the path of a folder, got"):
        cg.compile(graph(), backend, cache=choice)


@POSIX
@pytest.mark.parametrize(
    ("platform", "environment", "expected"),
    [
        ("linux", {"XDG_CACHE_HOME": "/caches"}, "/caches/cgraph"),
        ("linux", {}, "/people/me/.cache/cgraph"),
        ("linux", {"XDG_CACHE_HOME": ""}, "/people/me/.cache/cgraph"),
        ("linux", {"XDG_CACHE_HOME": "relative"}, "/people/me/.cache/cgraph"),
        ("darwin", {}, "/people/me/Library/Caches/cgraph"),
        ("win32", {"LOCALAPPDATA": "/people/me/local"}, "/people/me/local/cgraph"),
        ("win32", {}, "/people/me/AppData/Local/cgraph"),
    ],
)
def test_the_default_is_the_platforms_folder_for_caches(platform, environment, expected, monkeypatch):
    for name in ("XDG_CACHE_HOME", "LOCALAPPDATA"):
        monkeypatch.delenv(name, raising=False)
    for name, value in {**environment, "HOME": "/people/me"}.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(cache, "sys", type("sys", (), {"platform": platform}))
    assert cache.default_folder() == Path(expected)


def test_clearing_removes_the_entries_and_nothing_else(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    place = cache.default_folder()
    bits(cg.compile(graph(), "llvm", cache=True))
    mine = {f"notes{cache.SUFFIX}", f"notes{cache.UNFINISHED}", "notes.txt"}
    for name in mine:
        (place / name).write_text("mine")
    entries(place)[0].with_suffix(f".1f2e{cache.UNFINISHED}").write_bytes(b"of a process that was killed")
    assert clear_cache() == 2
    assert {path.name for path in place.iterdir()} == mine
    assert clear_cache(place) == 0
    assert clear_cache(tmp_path / "nothing here") == 0


def test_the_choice_is_no_matter_without_machine_code(folder, monkeypatch):
    monkeypatch.setitem(sys.modules, "llvmlite", None)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        function = cg.compile(graph(), cache=folder)
    assert function(POINT).shape == (2,)
    assert not folder.exists()
