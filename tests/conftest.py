"""What every test needs: fresh machine code, and no screen."""

import os
from pathlib import Path

ROOT = Path(__file__).parent.parent

os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
os.environ.setdefault("MPLBACKEND", "Agg")


def pytest_sessionstart():
    """Remove machine code older than what it may call: Numba looks at a function's own file."""
    packages = [ROOT / "curiosity_gym", ROOT / "curiosity_algos"]
    sources = [path for package in packages for path in package.rglob("*.py")]
    newest = max(path.stat().st_mtime for path in sources if "@compiled" in path.read_text())
    for package in packages:
        for cache in package.rglob("*.nb[ic]"):
            if cache.stat().st_mtime < newest:
                cache.unlink(missing_ok=True)
