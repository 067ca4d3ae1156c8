"""The Chromium of this machine."""

import shutil


def chromium() -> str | None:
    """Its program, where there is one."""
    return next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
