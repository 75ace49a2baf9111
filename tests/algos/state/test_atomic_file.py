import os
import socket
import subprocess
import sys

import pytest
from saved_files import no_space

from curiosity_algos.state.atomic_file import atomic_file


def save(path):
    with atomic_file(path) as file:
        file.write(b"new")


class TestAtomicFile:
    def test_the_file_appears_whole(self, tmp_path):
        path = tmp_path / "new" / "folder" / "file.zip"
        with atomic_file(path) as file:
            file.write(b"half")
            file.flush()
            assert not path.exists()
            file.write(b" and half")
        assert path.read_bytes() == b"half and half"
        assert list(path.parent.iterdir()) == [path]

    def test_an_error_leaves_the_old_file_alone(self, tmp_path):
        path = tmp_path / "file.zip"
        path.write_bytes(b"old")

        def write_half():
            with atomic_file(path) as file:
                file.write(b"new")
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            write_half()
        assert path.read_bytes() == b"old"
        assert list(tmp_path.iterdir()) == [path]

    @pytest.mark.parametrize("step", ["fsync", "replace"])
    def test_a_disk_that_fills_up_leaves_it_alone_too(self, tmp_path, monkeypatch, step):
        path = tmp_path / "file.zip"
        path.write_bytes(b"old")
        monkeypatch.setattr(os, step, no_space)
        with pytest.raises(OSError, match="No space left"):
            save(path)
        assert path.read_bytes() == b"old"
        assert list(tmp_path.iterdir()) == [path]


class TestStaleFiles:
    """What killed saves have left beside a file."""

    @pytest.fixture
    def gone(self):
        """The id of a process that has ended."""
        process = subprocess.Popen([sys.executable, "-c", ""])
        process.wait()
        return process.pid

    def test_a_killed_save_is_cleared_up(self, tmp_path):
        path = tmp_path / "file.[1].zip"
        code = f"""
import os, signal
from curiosity_algos.state.atomic_file import atomic_file
with atomic_file({str(path)!r}) as file:
    os.kill(os.getpid(), signal.SIGKILL)
"""
        subprocess.run([sys.executable, "-c", code], check=False)
        assert len(list(tmp_path.iterdir())) == 1
        save(path)
        assert list(tmp_path.iterdir()) == [path]

    def test_those_of_others_stay(self, tmp_path, gone):
        host, parent = socket.gethostname(), os.getppid()
        names = [
            f".file.zip.{host}.{parent}.tmp",  # lives
            f".file.zip.elsewhere.{gone}.tmp",  # its processes are not to be asked
            f".other.zip.{host}.{gone}.tmp",
            f".file.zip.{host}.notes.tmp",
            f"file.zip.{host}.{gone}.tmp",
        ]
        for name in names:
            (tmp_path / name).touch()
        (tmp_path / f".file.zip.{host}.{gone}.tmp").touch()
        save(tmp_path / "file.zip")
        assert {path.name for path in tmp_path.iterdir()} == {*names, "file.zip"}
