import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearsig.cache import write_text
from gearsig.errors import InputError
from gearsig.report import check_writable, page_names, recording_mark


@given(st.lists(st.text(max_size=300), max_size=20))
def test_page_names_are_unique_and_stay_in_their_folder(sources):
    names = page_names(sources)
    assert len(names) == len(sources)
    assert len({name.lower() for name in names}) == len(names)
    for name in names:
        assert name
        assert name == Path(name).name
        assert not name.startswith(".")
        assert not set(name) & set('/\\:*?"<>|\0\n #%&')
        assert len((name + ".html").encode()) < 235


def test_name_of_the_index_and_of_devices_are_not_taken():
    assert page_names(["index.csv", "CON.csv"]) == ("index-2", "CON-2")


def test_double_endings_go():
    assert page_names(["run.csv.gz", "run.csv", "RUN.mat"]) == ("run", "run-2", "RUN-3")


def test_runs_of_one_file_keep_their_numbers():
    assert page_names(["runs.mat#2", "runs.mat#3", "runs.mat"]) == ("runs_2", "runs_3", "runs")
    assert page_names(["runs.mat#3"]) == ("runs_3",)
    long = page_names([f"{'x' * 80}.mat#2", f"{'x' * 80}.mat#3"])
    assert [name[-3:] for name in long] == ["x_2", "x_3"]


def test_a_recording_keeps_its_page_and_gets_none_of_another(tmp_path):
    def page(name, mark):
        head = f'<meta name="gearsig-recording" content="{mark}">' if mark else ""
        (tmp_path / f"{name}.html").write_text(f"<!doctype html><head>{head}</head>")

    page("run", recording_mark("a/run.csv"))
    page("run-2", recording_mark("b/run.csv"))
    page("notes", "")
    page("other", recording_mark("c/run.csv"))
    assert page_names(["b/run.csv"], tmp_path) == ("run-2",)
    assert page_names(["c/RUN.csv", "b/run.csv", "a/run.csv"], tmp_path) == ("RUN-3", "run-2", "run")
    assert page_names(["c/run.csv", "notes.csv"], tmp_path) == ("run-3", "notes-2")
    assert page_names(["b/run.csv"], tmp_path / "absent") == ("run",)


def test_a_failed_write_leaves_what_was_there(tmp_path, monkeypatch):
    path = write_text(tmp_path / "page.html", "old")

    def full(_part, _target):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(type(path), "replace", full)
    with pytest.raises(InputError, match="No space left"):
        write_text(path, "x" * 1_000_000)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_what_cannot_be_written_is_named(tmp_path):
    (tmp_path / "page.html").mkdir()
    with pytest.raises(InputError, match=r"page\.html: cannot be written \(.+\); choose another folder with -o"):
        write_text(tmp_path / "page.html", "text")
    assert list(tmp_path.iterdir()) == [tmp_path / "page.html"]


def test_a_folder_is_writable_where_something_can_be_made_in_it_or_in_what_will_hold_it(tmp_path, monkeypatch):
    check_writable(tmp_path / "there" / "yet")
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "file").write_text("")
    for place, said in (("file", "is a file"), ("file/folder", "cannot be written")):
        with pytest.raises(InputError, match=said):
            check_writable(tmp_path / place)

    def deny(*_, **__):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(os, "open", deny)
    with pytest.raises(InputError, match=r"cannot be written \(Permission denied\)"):
        check_writable(tmp_path)


def test_a_full_disk_is_said_before_long_work(tmp_path):
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, before[1]))  # as if no more room were left
    try:
        with pytest.raises(InputError, match=r"there: cannot be written \(File too large\); choose .* with -o"):
            check_writable(tmp_path / "there")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert list(tmp_path.iterdir()) == []


def test_an_interrupted_write_is_tidied_up(tmp_path, monkeypatch):
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "replace", interrupt)
    with pytest.raises(KeyboardInterrupt):
        write_text(tmp_path / "page.html", "new")
    assert list(tmp_path.iterdir()) == []
