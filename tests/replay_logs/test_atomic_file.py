from contextlib import suppress

import pytest

from devices.errors import FileError
from replay_logs.atomic_file import check_file_place, check_folder_place, written_beside


def test_a_file_appears_whole(tmp_path):
    with written_beside(tmp_path / "a.gif") as part:
        part.write_text("all of it")
        assert part.suffix == ".gif"
        assert not (tmp_path / "a.gif").exists()
    assert [path.name for path in tmp_path.iterdir()] == ["a.gif"]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_or_not_at_all(tmp_path, error):
    (tmp_path / "a.txt").write_text("before")
    with suppress(error), written_beside(tmp_path / "a.txt") as part:
        part.write_text("half")
        raise error
    assert [path.read_text() for path in tmp_path.iterdir()] == ["before"]


def test_errors_name_the_file_that_was_asked_for(tmp_path):
    with pytest.raises(FileNotFoundError) as caught, written_beside(tmp_path / "nowhere" / "a.txt") as part:
        part.write_text("")
    assert caught.value.filename == str(tmp_path / "nowhere" / "a.txt")


def test_places_are_judged_before_anything_slow(tmp_path):
    (tmp_path / "file").write_text("")
    check_file_place(tmp_path / "file")
    check_folder_place(tmp_path)
    check_folder_place(tmp_path / "new" / "newer")
    for place, words in ((tmp_path / "new" / "a", "new does not exist"), (tmp_path, "a folder is there")):
        with pytest.raises(FileError, match=words):
            check_file_place(place)
    for place, words in ((tmp_path / "file", "a file is there"), (tmp_path / "file" / "in", "file is a file")):
        with pytest.raises(FileError, match=f"{words}; name a folder"):
            check_folder_place(place)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
