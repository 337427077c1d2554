"""The counts of an analysis, beside those of earlier versions."""

import counts

BEFORE = {"jobs": 100.0, "opened": 20.0, "MB read": 10.0, "MB peak": 5.0}


def test_a_count_that_differs_by_more_than_a_fifth_is_named() -> None:
    now = BEFORE | {"jobs": 121.0, "opened": 15.9, "MB read": 11.9}
    assert counts.list_differences(now, BEFORE) == [
        "jobs: 121, before 100",
        "opened: 15.9, before 20",
    ]
    assert counts.list_differences({"opened": 20.0, "MB read": 0.0}, BEFORE) == []


def test_the_last_row_of_the_history_has_all_counts() -> None:
    row = counts.read_last_row()
    assert list(row) == list(counts.COLUMNS)
    assert min(row.values()) > 0.0


def test_a_file_that_is_opened_is_counted() -> None:
    counts.opened.clear()
    counts.note_open("open", ("log.csv", "r", 0))
    counts.note_open("import", ("numpy",))
    assert counts.opened == ["log.csv"]
