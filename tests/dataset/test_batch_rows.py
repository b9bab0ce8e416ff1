"""Rows of a batch: refused by line, named safely, seeded from their ids, journaled whole."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenewright.dataset.batch.carry_out import publish
from scenewright.dataset.batch.journal import Journal, JournalEntry, lock_journal
from scenewright.dataset.batch.rows import DatasetRow, choose_folder, choose_seed, read_source
from scenewright.errors import InputError

HEADER: dict[str, Any] = {"journal": 1, "input": "a", "seed": 0}


def source(folder: Path, *lines: str) -> Path:
    path = folder / "in.jsonl"
    path.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8", newline="\n")
    return path


def row(identity: str, **more: Any) -> str:
    return json.dumps({"id": identity, "text": "A car follows a bus", **more})


@pytest.mark.parametrize(
    ("line", "facts"),
    [
        ("{", "not JSON"),
        ("[1]", "is an object"),
        ('{"id": "a"}', "'text'"),
        ('{"id": "", "text": "x"}', "id:"),
        ('{"id": 7, "text": "x"}', "id:"),
        ('{"id": "a", "text": "x", "sead": 1}', "sead"),
        ('{"id": "a", "text": "x", "seed": -1}', "seed"),
        ('{"id": "a", "text": "x", "seed": 1.0}', "seed"),
        ('{"id": "a", "text": "x", "id": "b"}', "twice"),
        ('{"id": "a", "text": "x", "overrides": {"density": "huge"}}', "density"),
        ('{"id": "a", "text": "x", "overrides": {"densty": "low"}}', "densty"),
        ('{"id": "first", "text": "again"}', "line 1"),
        ('{"id": "a", "text": "\\ud800"}', "surrogate"),
    ],
)
def test_a_bad_row_is_named_by_its_line(tmp_path: Path, line: str, facts: str) -> None:
    with pytest.raises(InputError, match=r"line 3: ") as found:
        read_source(source(tmp_path, row("first"), "", line))
    assert facts in str(found.value)
    assert "\n" not in str(found.value)


def test_bytes_that_are_no_text_are_named_by_their_line(tmp_path: Path) -> None:
    path = tmp_path / "in.jsonl"
    path.write_bytes(row("a").encode() + b'\n{"id": "\xff"}\n')
    with pytest.raises(InputError, match="line 2: not JSON"):
        read_source(path)


def test_plain_sentences_are_rows_by_their_lines(tmp_path: Path) -> None:
    given = source(tmp_path, "\ufeffA car follows a bus.", "", 'A "van" yields.', "{a} taxi yields")
    rows = [each.row for each in read_source(given)]
    assert [each.id for each in rows] == ["line-0001", "line-0003", "line-0004"]
    assert [each.text for each in rows][:2] == ["A car follows a bus.", 'A "van" yields.']
    given.write_bytes(b"A car follows a bus\nA van \xff\n")
    with pytest.raises(InputError, match=r"line 2: .*surrogate"):
        read_source(given)
    with pytest.raises(InputError, match=r"line 2: not JSON: .*or all are sentences"):
        read_source(source(tmp_path, row("a"), "A van yields."))


def test_no_rows_and_no_file_are_reported(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="holds no rows"):
        read_source(source(tmp_path, "", "  "))
    with pytest.raises(InputError, match="cannot read"):
        read_source(tmp_path / "nothing.jsonl")


@given(st.text(min_size=1, max_size=300))
def test_any_id_becomes_a_plain_name_below_the_folder(identity: str) -> None:
    name = choose_folder(identity)
    assert Path(name).name == name
    assert name not in (".", "..")
    assert len(name.encode()) <= 80
    assert name.isascii()
    assert not set(name) & set('/\\:*?"<>| \0')
    assert not name.endswith(".")


@given(st.sets(st.text(min_size=1, max_size=20), min_size=2, max_size=20))
def test_two_ids_never_share_a_folder(identities: set[str]) -> None:
    low = [identity.lower() for identity in identities]
    clashing = frozenset(each for each in low if low.count(each) > 1)
    names = [choose_folder(each, clashing=clashing).lower() for each in identities]
    assert len(set(names)) == len(names)


@pytest.mark.parametrize("identity", ["row-1", "Scene_001", "a.b", "7", "x" * 80])
def test_a_plain_id_is_its_folders_name(identity: str) -> None:
    assert choose_folder(identity) == identity


@pytest.mark.parametrize(
    "identity",
    ["../up", "/etc/passwd", "..", "con", "NUL.txt", "tables", "Manifest.json", "journal-1", "a/b",
     "x" * 81, "straße", "a ", "a.", ".hidden", f"a-{'0' * 16}"],
)  # fmt: skip
def test_any_other_id_is_hashed(identity: str) -> None:
    assert choose_folder(identity) != identity
    assert choose_folder(identity) == choose_folder(identity)


def test_ids_that_differ_by_case_get_folders_that_do_not(tmp_path: Path) -> None:
    path = source(tmp_path, row("Left"), row("left"), row("other"))
    names = [named.folder for named in read_source(path)]
    assert len({name.lower() for name in names}) == 3
    assert names[2] == "other"


def test_a_rows_seed_comes_from_its_id_and_the_runs_seed_alone() -> None:
    one, other = DatasetRow(id="a", text="x"), DatasetRow(id="b", text="x")
    assert choose_seed(one, seed=3) == choose_seed(DatasetRow(id="a", text="another text"), seed=3)
    assert (
        len({choose_seed(one, seed=3), choose_seed(one, seed=4), choose_seed(other, seed=3)}) == 3
    )
    assert choose_seed(DatasetRow(id="a", text="x", seed=11), seed=3) == 11


def entry(number: int, status: str = "made") -> JournalEntry:
    return JournalEntry(number, f"row-{number}", f"row-{number}", status, None, None, {}, 1, 0.0)


def test_a_journal_survives_a_torn_line(tmp_path: Path) -> None:
    with Journal(tmp_path, name="journal.jsonl", header=HEADER) as journal:
        journal.append(entry(0))
        journal.append(entry(2, "refused"))
    file = tmp_path / "journal.jsonl"
    whole = file.read_bytes()
    file.write_bytes(whole + b'{"number": 1, "key": "ro')
    with Journal(tmp_path, name="journal.jsonl", header=HEADER) as journal:
        assert [journal.get_entry(k) for k in range(4)] == [
            entry(0),
            None,
            entry(2, "refused"),
            None,
        ]
        journal.append(entry(1))
        assert journal.get_entry(1) == entry(1)
    assert file.read_bytes().startswith(whole + b'{"number":1,"key":"row-1"')


def test_the_last_word_on_a_row_counts_whichever_shard_said_it(tmp_path: Path) -> None:
    with Journal(tmp_path, name="journal-1-of-2.jsonl", header=HEADER) as journal:
        journal.append(entry(0, "failed"))
        journal.append(entry(0))
    with Journal(tmp_path, name="journal-2-of-2.jsonl", header=HEADER) as journal:
        journal.append(entry(1))
    with Journal(tmp_path, name=None, header=HEADER) as journal:
        assert [journal.get_entry(0), journal.get_entry(1)] == [entry(0), entry(1)]


def test_another_input_or_other_options_are_refused(tmp_path: Path) -> None:
    Journal(tmp_path, name="journal.jsonl", header=HEADER).close()
    with pytest.raises(InputError, match="seed was 0, now 1"):
        Journal(tmp_path, name="journal.jsonl", header={**HEADER, "seed": 1})
    with pytest.raises(InputError, match="the input has changed"):
        Journal(tmp_path, name="journal.jsonl", header={**HEADER, "input": "b"})


def test_two_runs_do_not_write_into_one_folder(tmp_path: Path) -> None:
    with (
        lock_journal(tmp_path, "journal.jsonl"),
        pytest.raises(InputError, match="another run"),
        lock_journal(tmp_path, "journal.jsonl"),
    ):
        pass


def test_nothing_but_a_scene_is_ever_replaced(tmp_path: Path) -> None:
    mine = tmp_path / "row-1"
    mine.mkdir()
    (mine / "thesis.tex").write_text("years of work")
    with pytest.raises(InputError, match="other things"):
        publish({"scene.json": b"{}"}, mine, parts=tmp_path / ".parts")
    assert (mine / "thesis.tex").read_text() == "years of work"
