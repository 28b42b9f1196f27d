"""axe-core on reports, whole, light and dark, at desktop and phone width.

    python benchmarks/accessibility.py demo-output/*/report.html [--pictures DIR]

Says what was found of each page, and takes its picture where one is wanted. The exit status is 1 if anything was found.
"""

from __future__ import annotations

import argparse
import sys
from itertools import product
from pathlib import Path

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import sync_playwright

WIDTHS = {1180: {}, 390: {"is_mobile": True, "has_touch": True}}


def main() -> int:
    """Look at every page four times."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("pages", nargs="+", type=Path, help="report.html files")
    parser.add_argument("--pictures", type=Path, help="folder for a picture of every page")
    parser.add_argument("--chromium", default="/usr/bin/chromium")
    asked = parser.parse_args()
    count = 0
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=asked.chromium, args=["--no-sandbox", "--disable-gpu"])
        for path, scheme, (width, kind) in product(asked.pages, ("light", "dark"), WIDTHS.items()):
            context = browser.new_context(viewport={"width": width, "height": 900}, color_scheme=scheme, **kind)
            page = context.new_page()
            page.goto(path.resolve().as_uri())
            page.wait_for_selector("html[data-ready=true]")
            # What is folded is part of the page.
            page.evaluate("document.querySelectorAll('details').forEach((each) => { each.open = true; })")
            found = Axe().run(page).response["violations"]
            count += len(found)
            print(f"{path} {scheme} {width}: {len(found)} findings", flush=True)
            for item in found:
                print(f"  {item['impact']} {item['id']}: {item['help']}; {item['nodes'][0]['html'][:120]}")
            if asked.pictures is not None:
                name = f"{path.parent.name}-{path.stem}-{scheme}-{width}.png"
                page.screenshot(path=asked.pictures / name, full_page=True)
            context.close()
        browser.close()
    return 1 if count else 0


if __name__ == "__main__":
    sys.exit(main())
