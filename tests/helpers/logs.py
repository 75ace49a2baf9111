"""Logs of trainings."""

import json


def read_log(folder):
    """The rows of Stable-Baselines3's log in a folder, of the format json."""
    return [json.loads(line) for line in (folder / "progress.json").read_text().splitlines()]
