"""Pages in a browser without a window."""

import html
import json
import re
import shutil
import subprocess

import pytest

needs_chromium = pytest.mark.skipif(shutil.which("chromium") is None, reason="needs chromium")


def run_in_page(page, script, width):
    """What a script puts into `document.body.dataset.said` as JSON, after a page was loaded."""
    page.write_text(page.read_text().replace("</body>", f"<script>{script}</script></body>"))
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking"]
    options += ["--no-first-run", "--disable-sync", f"--user-data-dir={page.parent / 'user'}"]
    options += [f"--window-size={width},900", "--virtual-time-budget=3000", "--dump-dom"]
    command = ["chromium", *options, page.as_uri()]
    ran = subprocess.run(command, capture_output=True, text=True, timeout=120)
    return json.loads(html.unescape(re.search(r'data-said="(.*?)"', ran.stdout)[1]))
