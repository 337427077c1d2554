"""Take the pictures of the README: the page of one log, and the first screen of a report.

    python docs/images/take.py bench results    (of the tutorial, and of the demonstration)

It needs what `test` installs. The colours are reduced to 256.
"""

from __future__ import annotations

import io
import os
import shutil
import sys
from pathlib import Path

from PIL import Image
from playwright.sync_api import sync_playwright

WIDTH = 1080


def main(one_log: Path, results: Path) -> None:
    """Write `one_log.png` and `report.png` beside this file."""
    browser = os.environ.get("PLAYWRIGHT_CHROMIUM") or shutil.which("chromium")
    pictures = {
        "one_log.png": (one_log / "report.html", "figure .plot-container"),
        "report.png": (results / "report/index.html", "table.decisions"),
    }
    with sync_playwright() as driver:
        opened = driver.chromium.launch(executable_path=browser, args=["--no-sandbox"])
        for name, (shown, last) in pictures.items():
            page = opened.new_page(viewport={"width": WIDTH, "height": 900})
            page.goto(shown.resolve().as_uri())
            page.wait_for_selector(last)
            end = page.eval_on_selector(last, "e => e.getBoundingClientRect().bottom + scrollY")
            clip = {"x": 0, "y": 0, "width": WIDTH, "height": end + 1}
            taken = Image.open(io.BytesIO(page.screenshot(full_page=True, clip=clip)))
            few = taken.convert("RGB").quantize(256, kmeans=2)
            few.save(Path(__file__).with_name(name), optimize=True)
        opened.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
