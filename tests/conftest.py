"""Hypothesis profiles: the default run is reproducible and short; HYPOTHESIS_PROFILE=full or explore tries more."""

import atexit
import gc
import os
import signal
import sys
import threading
from collections.abc import Callable, Generator, Iterator
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from hypothesis import HealthCheck, settings

from cgraph import clear_caches
from cgraph.codegen import llvm_engine
from tests.chromium import chromium

if sys.dont_write_bytecode:  # else every process that a test starts would compile the library anew
    _bytecode = TemporaryDirectory(prefix="cgraph-bytecode-")
    atexit.register(_bytecode.cleanup)
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # python -B sets none
    os.environ["PYTHONPYCACHEPREFIX"] = sys.pycache_prefix = _bytecode.name
    sys.dont_write_bytecode = False

_slow_is_fine = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow, HealthCheck.data_too_large]}
settings.register_profile("reproducible", max_examples=18, derandomize=True, database=None, **_slow_is_fine)
settings.register_profile("full", max_examples=100, derandomize=True, database=None, **_slow_is_fine)
settings.register_profile("explore", max_examples=2000, print_blob=True, **_slow_is_fine)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "reproducible"))


# Importing 200 test files takes as long as running a tenth of them, mostly to rewrite their asserts and compile them.
# The result is kept in files: of two workers one goes from the first test file to the last and the other from the last
# to the first, and each reads what the other has made.
BACKWARDS = os.environ.get("PYTEST_XDIST_WORKER", "gw0")[-1] in "13579"


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(collector: pytest.Collector) -> Generator[None, Any, Any]:
    """What is in a folder, in the order of this worker."""
    report = yield
    if BACKWARDS and isinstance(collector, pytest.Dir):
        report.result.reverse()
    return report


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Workers have to agree on the order of the tests."""
    if "PYTEST_XDIST_WORKER" in os.environ:
        items.sort(key=lambda item: item.path.parts)


def pytest_collection_finish() -> None:
    """Modules and tests stay to the end: the garbage collector need not walk through them, nor come as often."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000, 20, 20)


_translate = llvm_engine.Host._translated
_made: dict[bytes, bytes] = {}  # {digest of a text: its machine code}


def _quickly(host: llvm_engine.Host, text: str, level: int) -> bytes:
    digest = sha256(text.encode()).digest()
    if digest not in _made:
        _made[digest] = _translate(host, text, 0)
    return _made[digest]


@pytest.fixture(autouse=True)
def quick_machine_code(request: pytest.FixtureRequest) -> Iterator[None]:
    """LLVM's code generator does not optimize, in a quarter of the time, but where its code is what a test is about.

    Products and sums are then not fused, so that last bits are those of a processor without such an instruction. What
    it has made of the same text is taken again: a third of all. With HYPOTHESIS_PROFILE all code is optimized, as users
    have it; a test about it takes none of what others have left.
    """
    users = "optimized" in request.keywords or "HYPOTHESIS_PROFILE" in os.environ
    with pytest.MonkeyPatch.context() as patch:
        if "optimized" in request.keywords:
            clear_caches()
        if not users:
            patch.setattr(llvm_engine, "LEVEL", 0)
            patch.setattr(llvm_engine.Host, "_translated", _quickly)
        yield


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder, in which the test runs."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def without(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    """Importing a module fails from here on, as where its package is not installed."""
    return lambda module: monkeypatch.setitem(sys.modules, module, None)


@pytest.fixture
def ctrl_c() -> Iterator[Callable[[float], threading.Timer]]:
    """A function that presses Ctrl-C after so long [s], unless the test is over by then.

    It raises KeyboardInterrupt even where the tests were started with SIGINT ignored, as background jobs are.
    """
    main, timers = threading.get_ident(), list[threading.Timer]()

    def after(seconds: float) -> threading.Timer:
        timers.append(threading.Timer(seconds, lambda: signal.pthread_kill(main, signal.SIGINT)))
        timers[-1].start()
        return timers[-1]

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield after
    for timer in timers:
        timer.cancel()
        timer.join()
    signal.signal(signal.SIGINT, before)


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    api = pytest.importorskip("playwright.sync_api", reason="the browser extra has it")
    if (program := chromium()) is None:
        pytest.skip("there is no Chromium on PATH")
    with api.sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=program, args=["--no-sandbox"])
        yield opened
        opened.close()


@pytest.fixture
def visit(browser: Any) -> Iterator[Callable[..., Any]]:
    """Opens the page of a file, which must neither ask for anything nor complain; closed after the test."""
    pages, said, asked = [], [], []

    def opened(path: Path, fragment: str = "", width: int = 1280, height: int = 720, **options: Any) -> Any:
        page = browser.new_page(viewport={"width": width, "height": height}, **options)
        page.on("console", lambda message: said.append(message.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.on("dialog", lambda dialog: (said.append(dialog.message), dialog.dismiss()))
        page.on("request", lambda request: asked.append(request.url))
        page.goto(path.as_uri() + fragment)
        pages.append(page)
        return page

    yield opened
    for page in pages:
        page.close()
    assert said == []
    assert [url for url in asked if not url.startswith(("file:", "data:"))] == []
