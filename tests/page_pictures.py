"""The pictures that the examples of the pages write, into docs/images: `make pictures`, or for some pages

python -m tests.page_pictures docs/derivatives.md
"""

import shutil
import sys
import tempfile
from pathlib import Path

from tests.test_docs import PAGES, ROOT, pictures, run_examples


def main(names: list[str]) -> None:
    """Run the pages and copy what they wrote."""
    for name in names or [name for name in PAGES if pictures(name)]:
        with tempfile.TemporaryDirectory() as folder:
            run = run_examples(name, Path(folder))
            if run.returncode:
                sys.exit(f"{name}: {run.stderr}")
            for written, image in pictures(name).items():
                shutil.copy(Path(folder, "empty", written), ROOT / "docs" / image)


if __name__ == "__main__":
    main(sys.argv[1:])
