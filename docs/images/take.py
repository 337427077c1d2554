"""Take the picture of the README: the first screen of a report, with its decision matrix.

    python docs/images/take.py results    (of the demonstration; with what `test` installs)

The colours are reduced to 256.
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


def main(results: Path) -> None:
    """Write `report.png` beside this file."""
    browser = os.environ.get("PLAYWRIGHT_CHROMIUM") or shutil.which("chromium")
    with sync_playwright() as driver:
        opened = driver.chromium.launch(executable_path=browser, args=["--no-sandbox"])
        page = opened.new_page(viewport={"width": WIDTH, "height": 900})
        page.goto((results / "report/index.html").resolve().as_uri())
        end = page.eval_on_selector(
            "#next-steps + ol", "e => e.getBoundingClientRect().bottom + scrollY"
        )
        clip = {"x": 0, "y": 0, "width": WIDTH, "height": end + 12}
        taken = Image.open(io.BytesIO(page.screenshot(full_page=True, clip=clip)))
        opened.close()
    few = taken.convert("RGB").quantize(256, kmeans=2)
    few.save(Path(__file__).with_name("report.png"), optimize=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
