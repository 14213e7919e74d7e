"""What a user installs: the wheel is the whole package, and its commands exist."""

from __future__ import annotations

import importlib.metadata
import re
import zipfile
from pathlib import Path

import pytest
from flit_core import buildapi

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "src" / "sheetoflight"
LOCKS = ("run.txt", "dev.txt")


def source_files() -> set[str]:
    return {
        str(path.relative_to(ROOT / "src"))
        for path in PACKAGE.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }


def test_the_wheel_holds_every_file_of_the_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(ROOT)
    wheel = tmp_path / buildapi.build_wheel(str(tmp_path))
    with zipfile.ZipFile(wheel) as archive:
        packed = {name for name in archive.namelist() if ".dist-info/" not in name}
    assert packed == source_files()


@pytest.mark.parametrize("command", ["sol", "sheetoflight"])
def test_the_command_leads_to_a_function(command: str):
    (entry,) = importlib.metadata.entry_points(group="console_scripts", name=command)
    assert callable(entry.load())


@pytest.mark.parametrize("lock", LOCKS)
def test_a_lock_file_names_hashes_and_no_address(lock: str):
    text = (ROOT / "requirements" / lock).read_text(encoding="utf-8")
    assert not re.search(r"://|--index-url|--extra-index-url|--find-links|(^|\s)[~/]", text)
    pinned = re.findall(r"^\S+==\S+.*\\\n {4}--hash=sha256:[0-9a-f]{64}", text, flags=re.MULTILINE)
    named = re.findall(r"^[a-z0-9].*", text, flags=re.MULTILINE)
    assert named
    assert len(pinned) == len(named)


def test_both_lock_files_agree():
    run, dev = (pins((ROOT / "requirements" / lock).read_text(encoding="utf-8")) for lock in LOCKS)
    assert run.items() <= dev.items()
    assert "flit-core" in run


def pins(text: str) -> dict[str, str]:
    """Version and environment marker of every package of a lock file."""
    return dict(re.findall(r"^([a-z0-9-]+)==(.+?) *\\$", text, flags=re.MULTILINE))
