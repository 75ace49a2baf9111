"""Models of robots of one's own: Gymnasium's, changed."""

from pathlib import Path


def changed_model(folder, name, *changes):
    """A copy of one of Gymnasium's XML files with (old, new) replaced, as a path."""
    from gymnasium.envs import mujoco

    text = (Path(mujoco.__file__).parent / "assets" / name).read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = folder / name
    path.write_text(text)
    return str(path)
