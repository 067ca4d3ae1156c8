"""Machine code on disk: it is found again, only where it belongs, and never in the way."""

import errno
import os
import pickle
import stat
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import cgraph as cg
from cgraph import clear_cache
from cgraph.codegen import disk_cache as cache, llvm_engine as llvm
from tests.each_row import each_row

pytestmark = pytest.mark.optimized

llvmlite = pytest.importorskip("llvmlite")
binding = pytest.importorskip("llvmlite.binding")

ROOT = Path(__file__).parents[3]
POINT = [0.3, -0.7]
POINTS = np.linspace([-2.0, 0.5], [1e7, 3.0], 37).T  # beyond the range of the polynomials, too
POSIX = pytest.mark.skipif(os.name == "nt", reason="permissions of POSIX")
CODE = bytes(range(256)) * 4


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "kept"


def entries(folder):
    return sorted(folder.glob(f"*{cache.SUFFIX}"))


class Kept:
    """Code that is kept in a folder, and how often it was made."""

    def __init__(self, folder):
        self.folder, self.made = folder, 0

    def __call__(self, recipe="a recipe", code=CODE):
        def make():
            self.made += 1
            return code

        return cache.cached_code(self.folder, recipe, make)


def flipped(position):
    def damage(content):
        changed = bytearray(content)
        changed[position] ^= 0x10
        return bytes(changed)

    return damage


DAMAGE = {
    "checksum": flipped(5),
    "first byte": flipped(32),
    "last byte": flipped(-1),
    "short": lambda content: content[:-1],
    "half": lambda content: content[: len(content) // 2],
    "checksum alone": lambda content: content[:32],
    "empty": lambda _: b"",
    "long": lambda content: content + b"\0",
    "garbage": lambda _: bytes(range(256)) * 9,
    "zeros": lambda content: bytes(len(content)),
}


def test_a_damaged_entry_is_made_anew_and_never_given(folder):
    kept = Kept(folder)
    assert (kept(), kept(), kept.made) == (CODE, CODE, 1)
    (path,) = entries(folder)
    good = path.read_bytes()
    for count, (name, damage) in enumerate(DAMAGE.items(), 2):
        path.write_bytes(damage(good))
        assert (kept(), kept(), kept.made) == (CODE, CODE, count), name
        assert path.read_bytes() == good


def test_an_entry_under_another_name_is_not_believed(folder):
    kept = Kept(folder)
    kept()
    (one,) = entries(folder)
    kept("another recipe", b"other code")
    (other,) = set(entries(folder)) - {one}
    other.write_bytes(one.read_bytes())
    assert (kept("another recipe", b"other code"), kept.made) == (b"other code", 3)


@POSIX
def test_the_folder_and_its_entries_are_the_owners_alone_and_what_others_could_write_is_not_believed(
    folder, monkeypatch
):
    kept, old = Kept(folder), os.umask(0)
    try:
        kept()
    finally:
        os.umask(old)
    (path,) = entries(folder)
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    for count, mode in enumerate((0o620, 0o602), 2):
        path.chmod(mode)
        assert (kept(), kept.made) == (CODE, count)
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
    theirs, real = path.stat().st_ino, os.fstat

    def fstat(file):
        status = real(file)
        return os.stat_result((*status[:4], 12345, *status[5:])) if status.st_ino == theirs else status

    monkeypatch.setattr(os, "fstat", fstat)
    assert (kept(), kept(), kept.made) == (CODE, CODE, 4)  # ours has taken the place of theirs


@POSIX
def test_what_is_no_entry_is_neither_waited_for_nor_read(folder):
    kept = Kept(folder)
    kept()
    (path,) = entries(folder)
    strange = {
        "a pipe to which nobody will write": lambda: os.mkfifo(path, 0o600),
        "a device without an end": lambda: path.symlink_to("/dev/zero"),
        "a huge file, sparse": lambda: (path.touch(0o600), os.truncate(path, 2**36)),
    }
    for count, (name, make) in enumerate(strange.items(), 2):
        path.unlink()
        make()
        assert (kept(), kept.made) == (CODE, count), name
        assert path.is_file()
        assert not path.is_symlink()  # an entry has taken its place


def test_what_cannot_be_kept_is_given_with_a_warning(folder, monkeypatch):
    kept = Kept(folder)
    folder.write_text("mine")
    with pytest.warns(RuntimeWarning, match=r"machine code is not kept in .*kept: File exists|Not a directory"):
        assert kept() == CODE
    assert folder.read_text() == "mine"
    folder.unlink()
    kept()
    (path,) = entries(folder)
    path.unlink()
    path.mkdir()  # in place of the entry
    with pytest.warns(RuntimeWarning, match="not kept"):
        assert kept() == CODE
    assert list(folder.iterdir()) == [path]

    def replace(path, target):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))

    path.rmdir()
    monkeypatch.setattr(Path, "replace", replace)
    with pytest.warns(RuntimeWarning, match="No space left"):
        assert kept() == CODE
    assert list(folder.iterdir()) == []


def test_a_folder_that_cannot_be_written_still_gives_what_it_has(folder, monkeypatch):
    kept, real = Kept(folder), os.open
    kept()

    def read_only(path, flags, *mode):
        if flags & os.O_CREAT:
            raise OSError(errno.EROFS, os.strerror(errno.EROFS))
        return real(path, flags, *mode)

    monkeypatch.setattr(os, "open", read_only)
    assert (kept(), kept.made) == (CODE, 1)  # and no warning, which would be an error here
    with pytest.warns(RuntimeWarning, match="Read-only"):
        kept("another recipe")


WORKER = """
import sys
from pathlib import Path
from cgraph.codegen.disk_cache import cached_code
print("ready", flush=True)
sys.stdin.readline()
codes = [bytes([k]) * 10_000 for k in range(200)]
print([cached_code(Path(sys.argv[1]), f"{k}", lambda: code) for k, code in enumerate(codes)] == codes)
"""


def test_processes_and_threads_may_fill_one_folder_at_once(folder):
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True, "cwd": ROOT}
    command = [sys.executable, "-W", "error", "-c", WORKER, str(folder)]
    workers = [subprocess.Popen(command, **pipes) for _ in range(2)]
    for worker in workers:
        assert worker.stdout.readline() == "ready\n"
    for worker in workers:
        worker.stdin.write("go\n")
        worker.stdin.flush()
    assert [worker.communicate()[0] for worker in workers] == ["True\n"] * 2
    assert len(entries(folder)) == len(list(folder.iterdir())) == 200
    with ThreadPoolExecutor(8) as pool:
        assert set(pool.map(lambda _: Kept(folder)("of a thread"), range(64))) == {CODE}
    assert len(entries(folder)) == len(list(folder.iterdir())) == 201


def graph(constant=2.5):
    x, y = cg.variables("x y")
    return cg.Graph([x, y], {"u": cg.sin(x) * cg.exp(-y) + x * y, "v": cg.atan2(x, y) * constant + x})


def bits(function):
    return function(POINT).tobytes(), function.batch(POINTS).tobytes()


def test_the_second_compilation_translates_nothing_and_has_the_same_values_whatever_the_names(folder, monkeypatch):
    translated, real = [], binding.TargetMachine.emit_object
    monkeypatch.setattr(binding.TargetMachine, "emit_object", lambda *of: translated.append(of) or real(*of))
    plain = bits(cg.compile(graph(), "llvm"))
    del translated[:]
    first = bits(cg.compile(graph(), "llvm", cache=folder))
    assert len(translated) == len(entries(folder)) == 2  # for a point, for batches
    with cg.tag("link 1"):
        a, b = cg.variables("a b")
        again = cg.Graph([a, b], {"first": cg.sin(a) * cg.exp(-b) + a * b, "second": cg.atan2(a, b) * 2.5 + a})
    second, named = (bits(cg.compile(each, "llvm", cache=folder)) for each in (graph(), again))
    assert len(translated) == len(entries(folder)) == 2
    assert first == second == named == plain


def test_without_the_option_nothing_is_written(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    bits(cg.compile(graph(), "llvm"))
    assert list(tmp_path.iterdir()) == []


def other_binding(**changed):
    """LLVM where it says something else about itself or the processor."""
    return SimpleNamespace(**(vars(binding) | changed))


TEXT = "define void @nothing() { ret void }"
HOSTS = {
    "processor": (other_binding(get_host_cpu_name=lambda: "generic"), llvmlite.__version__, 1),
    "features": (other_binding(get_host_cpu_features=lambda: fewer_features()), llvmlite.__version__, 1),
    "LLVM": (other_binding(llvm_version_info=(99, 0, 0)), llvmlite.__version__, 1),
    "llvmlite": (binding, "99.0", 1),
    "optimisation": (binding, llvmlite.__version__, llvm.QUICK + 1),
}
OPTIONS = {"fma": {"fma": False}, "fast": {"fast": True}, "a constant's last bit": {}}


def fewer_features():
    features = binding.get_host_cpu_features()
    features["fma"] = not features.get("fma", False)
    return features


def test_other_code_has_other_entries(folder):
    llvm.host().compile(TEXT, (), 1, folder)
    for count, (name, (other, version, nodes)) in enumerate(HOSTS.items(), 2):
        llvm.Host(other, version).compile(TEXT, (), nodes, folder)
        assert len(entries(folder)) == count, name
    cg.compile(graph(), "llvm", cache=folder).batch(POINTS)
    for count, (name, options) in enumerate(OPTIONS.items(), 2):
        changed = graph() if options else graph(np.nextafter(2.5, 3.0))
        cg.compile(changed, "llvm", cache=folder, **options).batch(POINTS)
        assert len(entries(folder)) == 1 + len(HOSTS) + 2 * count, name


def test_a_user_without_a_home_gets_a_warning(monkeypatch):
    def home(_):
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.delenv("LOCALAPPDATA", raising=False)
    monkeypatch.setattr(Path, "home", classmethod(home))
    with pytest.warns(RuntimeWarning, match="home"):
        assert cg.compile(graph(), "llvm", cache=True).batch(POINTS).shape == (2, 37)


def test_a_function_of_libm_that_is_missing_is_an_error_even_with_the_code_at_hand(folder, monkeypatch):
    cg.compile(graph(), "llvm", cache=folder)
    monkeypatch.setattr(binding, "address_of_symbol", lambda name: None if name == "atan2" else 1)
    with pytest.raises(RuntimeError, match="has no atan2"):
        cg.compile(graph(), "llvm", cache=folder)


def test_a_pickle_keeps_the_choice(backend, folder):
    options = {"cache": str(folder), "fast": True, "fma": False}
    function = cg.compile(graph(), backend, **options)
    restored = pickle.loads(pickle.dumps(function))
    assert restored.options == function.options == options
    assert bits(restored) == bits(function)


def test_a_relative_path_means_the_folder_it_meant(here, monkeypatch):
    function = cg.compile(graph(), "llvm", cache="here")
    (here / "elsewhere").mkdir()
    monkeypatch.chdir(here / "elsewhere")
    function.batch(POINTS)
    pickle.loads(pickle.dumps(function))
    assert len(entries(here / "here")) == 2
    assert list((here / "elsewhere").iterdir()) == []


@POSIX
@each_row(
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
