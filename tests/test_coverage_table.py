"""The table of `make coverage` adds up files to packages, and packages to a last line."""

from coverage_table import table


def entry(lines, ran):
    return {"summary": {"num_statements": lines, "covered_lines": ran}}


def test_the_table_has_each_package_once_and_all_of_them_last():
    text = table(
        {
            "src/slosh_model/slosh_model/b.py": entry(30, 15),
            "src/slosh_bag/slosh_bag/a.py": entry(10, 10),
            "src/slosh_model/slosh_model/__init__.py": entry(0, 0),
            "src/slosh_model/slosh_model/c.py": entry(10, 5),
            "/tmp/poisoned/slosh_model/c.py": entry(10, 10),
        }
    )
    assert text.splitlines()[2:] == [
        "| slosh_bag | 10 | 10 | 100.0 % |",
        "| slosh_model | 40 | 20 | 50.0 % |",
        "| all | 50 | 30 | 60.0 % |",
    ]
