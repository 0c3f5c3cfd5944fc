"""Which programs files and folders name, and the report folder of each."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from toolpath_stiff.cli.program import analyze
from toolpath_stiff.errors import InputError
from toolpath_stiff.report.batch.programs import ENDINGS, RESERVED, Found, find_programs, report_folders


@pytest.fixture
def jobs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in (
        "jobs/b.nc", "jobs/A.NC", "jobs/deep/er/b.tap", "jobs/.hidden.nc", "jobs/.git/x.nc", "jobs/notes.txt",
        "jobs/Makefile", "jobs/deep/list.TXT", "other/b.nc",
    ):  # fmt: skip
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("F1000\nG1 X1\n")
    return tmp_path


def test_a_folder_stands_for_its_programs_and_counts_the_rest(jobs):
    found, counts = find_programs(["jobs"])
    assert [program.file for program in found] == ["jobs/A.NC", "jobs/b.nc", "jobs/deep/er/b.tap"]
    assert [str(count) for count in counts] == [
        "jobs: 3 programs; other files are left alone: 1 without an ending, 2 .txt"
    ]


def test_numbers_in_names_are_sorted_as_numbers(jobs):
    for name in ("other/p10.nc", "other/p9.nc", "other/p9/10.nc", "other/p9/9.nc", "other/P9.nc"):
        path = jobs / name
        path.parent.mkdir(exist_ok=True)
        path.touch()
    found, _ = find_programs(["other"])
    assert [str(program.inside) for program in found] == [
        "P9.nc", "b.nc", "p9/9.nc", "p9/10.nc", "p9.nc", "p10.nc",
    ]  # fmt: skip


def test_the_help_names_every_ending():
    assert all(f" {ending}" in analyze.__doc__ for ending in ENDINGS)


def test_a_file_named_twice_in_any_way_is_read_once(jobs):
    (jobs / "link.nc").symlink_to("other/b.nc")
    found, _ = find_programs(["other/b.nc", "other", "./other/../other/b.nc", str(jobs / "other/b.nc"), "link.nc"])
    assert [program.file for program in found] == ["other/b.nc"]


def test_linked_folders_are_not_entered_and_dead_links_are_programs_that_fail_later(jobs):
    (jobs / "other/around").symlink_to(jobs / "other", target_is_directory=True)
    (jobs / "other/gone.nc").symlink_to("nowhere.nc")
    found, _ = find_programs(["other"])
    assert [program.file for program in found] == ["other/b.nc", "other/gone.nc"]


def test_a_folder_without_programs_is_one_error(jobs):
    (jobs / "empty/.nc").mkdir(parents=True)
    with pytest.raises(InputError, match="no NC program in folder 'empty'"):
        find_programs(["jobs", "empty"])


def folders(*programs: tuple[str, str]) -> list[str]:
    listed = report_folders([Found(file, Path(inside)) for file, inside in programs])
    return [one.folder.as_posix() for one in listed]


@pytest.mark.parametrize(
    ("programs", "expected"),
    [
        ([("x/part.nc", "part.nc"), ("other.nc", "other.nc")], ["part", "other"]),
        ([("jobs/a/part.nc", "a/part.nc"), ("jobs/part.nc", "part.nc")], ["a/part", "part"]),
        ([("/w/a/part.nc", "part.nc"), ("/w/b/part.nc", "part.nc"), ("/w/c.nc", "c.nc")], ["a/part", "b/part", "c"]),
        ([("/w/a/x/part.nc", "part.nc"), ("/w/b/x/part.nc", "part.nc")], ["a/x/part", "b/x/part"]),
        ([("part.nc", "part.nc"), ("sub/part.nc", "part.nc")], ["part", "sub/part"]),
        ([("../part.nc", "part.nc"), ("../sub/part.nc", "part.nc")], ["part", "sub/part"]),
        ([("part.nc", "part.nc"), ("part.tap", "part.tap")], ["part.nc", "part.tap"]),
        ([("j/part.nc", "part.nc"), ("j/part/side.nc", "part/side.nc")], ["part.nc", "part/side.nc"]),
        ([("/w/a/Part.nc", "Part.nc"), ("/w/b/part.nc", "part.nc")], ["a/Part", "b/part"]),
        ([("part.nc", "part.nc"), ("part.tap", "part.tap"), ("part.nc.nc", "part.nc.nc")],
         ["part.nc", "part.tap", "part.nc.nc"]),
    ],
)  # fmt: skip
def test_report_folders_are_as_short_as_can_be_told_apart(programs, expected):
    assert folders(*programs) == expected


def test_a_report_folder_never_takes_the_name_of_the_overview():
    assert folders(("/w/j/index.html.nc", "index.html.nc"))[0] not in RESERVED


names = st.sampled_from(["a", "b", "part", "part.nc", "index.html"])
suffixes = st.sampled_from([".nc", ".tap", ""])
paths = st.builds(
    lambda above, name, ending: "/".join([*above, name + ending]), st.lists(names, max_size=3), names, suffixes
)


@given(st.lists(st.tuples(paths, st.integers(1, 4)), unique_by=lambda one: one[0], max_size=8))
def test_no_report_folder_is_another_ones_nor_within_it(chosen):
    files = [Path("/w", path) for path, _ in chosen]
    if any(one in other.parents for one in files for other in files):
        return  # a file cannot be a folder as well
    found = [
        Found(str(file), Path(*file.parts[-min(n, len(file.parts) - 1) :]))
        for file, (_, n) in zip(files, chosen, strict=True)
    ]
    listed = report_folders(found)
    taken = [one.folder for one in listed]
    assert [one.file for one in listed] == [str(file) for file in files]
    assert len({one.name for one in listed}) == len(listed) == len(set(taken))
    assert not any(one in other.parents for one in taken for other in taken)
    assert not any(folder.parts[0] in RESERVED for folder in taken)
