"""`slosh report`: files of a validation report, and what is found of later changes."""

import json
import re
import shutil
import sys
from pathlib import Path

import pytest

from slosh_bringup.cli.main import main
from slosh_fleet.validation.seal import check_seal, seal_line, sealed
from slosh_report.errors import SloshReportError

BAGS = Path(__file__).parents[3] / "bags"


@pytest.fixture
def fpdf():
    return pytest.importorskip("fpdf", reason="fpdf2 is not installed (requirements/pdf.txt)")


@pytest.fixture
def bag(tmp_path):
    return shutil.copytree(BAGS / "c", tmp_path / "c")


def write(bag, output, *more):
    return main(["report", "--validation", str(bag), "-o", str(output), *map(str, more)])


def verify(report, *more):
    return main(["report", "--verify", str(report), *map(str, more)])


def test_a_report_is_unchanged(bag, tmp_path, capsys):
    report = tmp_path / "report.html"
    assert write(bag, report, "--limit", "60mm") == 0
    digest = re.search(r"content: ([0-9a-f]{64})", capsys.readouterr().out)[1]
    assert verify(report, "--digest", digest) == 0
    assert "unchanged" in capsys.readouterr().out
    assert verify(report, "--digest", "0" * 64) == 1
    assert "not the signed one" in capsys.readouterr().err


def test_the_same_input_gives_the_same_bytes(bag, tmp_path, fpdf):
    for name in ("a", "b"):
        write(bag, tmp_path / f"{name}.pdf", "-o", tmp_path / f"{name}.html")
    for ending in ("pdf", "html"):
        one, other = (tmp_path / f"{name}.{ending}" for name in ("a", "b"))
        assert one.read_bytes() == other.read_bytes()


@pytest.mark.parametrize("old", [b"decision", b'"height":', b"</html>", b"slosh-seal sha256:"])
def test_any_change_of_a_page_is_found(bag, tmp_path, capsys, old):
    report = tmp_path / "report.html"
    write(bag, report)
    content = report.read_bytes()
    assert content.count(old) >= 1
    changed = content.replace(old, old[:-1] + bytes([old[-1] ^ 2]), 1)
    report.write_bytes(changed)
    assert verify(report) == 1
    assert "changed" in capsys.readouterr().err


def test_a_changed_pdf_is_found(bag, tmp_path, capsys, fpdf):
    report = tmp_path / "report.pdf"
    write(bag, report)
    assert verify(report) == 0
    content = bytearray(report.read_bytes())
    content[len(content) // 3] ^= 1
    report.write_bytes(content)
    assert verify(report) == 1
    assert "changed" in capsys.readouterr().err


def test_a_content_that_is_sealed_again_has_another_digest(bag, tmp_path, capsys):
    report = tmp_path / "report.html"
    write(bag, report)
    text = report.read_text("utf-8")
    digest = check_seal(text.encode(), "report").digest
    forged = re.sub(r'"verdict":"\w+"', '"verdict":"pass"', text, count=1)
    forged = re.sub(r"slosh-seal sha256:\w+", seal_line(), forged)
    report.write_bytes(sealed(forged.encode()))
    assert verify(report, "--digest", digest) == 1
    assert "not the signed one" in capsys.readouterr().err


def test_a_moved_bag_is_found_by_its_folder(bag, tmp_path, capsys):
    report = tmp_path / "report.html"
    write(bag, report)
    bag.rename(tmp_path / "archive")
    assert verify(report) == 1
    assert "--data FOLDER" in capsys.readouterr().err
    assert verify(report, "--data", tmp_path / "archive") == 0


def test_a_changed_bag_is_named(bag, tmp_path, capsys):
    report = tmp_path / "report.html"
    write(bag, report)
    (bag / "metadata.yaml").write_text("other: 1\n")
    assert verify(report) == 1
    assert "metadata.yaml: was changed since the report" in capsys.readouterr().err


def test_the_verdict_is_the_exit_code(bag, tmp_path):
    assert write(bag, tmp_path / "a.html", "--limit", "60mm") == 0
    assert write(bag, tmp_path / "a.html", "--limit", "1mm") == 1


def test_the_signed_content_is_printed_as_json(bag, capsys):
    main(["report", "--validation", str(bag), "--json", "--issued", "2026-11-26"])
    content = json.loads(capsys.readouterr().out)
    assert content["issued"] == "2026-11-26"
    assert content["signatures"][0]["role"] == "Prepared by"


def test_texts_are_escaped(bag, tmp_path):
    report = tmp_path / "report.html"
    write(bag, report, "--title", "<script>alert(1)</script>", "--signature", "A=<b>")
    text = report.read_text("utf-8")
    assert "<script>alert" not in text
    assert "<b>" not in text.partition("Signatures")[2].partition("<pre>")[0]
    assert verify(report) == 0


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("--validation", "at least one BAG"),
        ("--validation BAG", "give the file of the report"),
        ("--validation BAG -o OUT/a.txt", "a .html or a .pdf file"),
        ("--validation BAG -o OUT/none/a.html", "there is no folder"),
        ("--validation BAG -o OUT", "a .html or a .pdf file"),
        ("--validation BAG BAG -o OUT/a.html", "given twice"),
        ("--validation BAG -o OUT/a.html --max-mae -1mm", "at least 0"),
        ("--validation OUT/absent -o OUT/a.html", "no such file or folder"),
        ("--verify OUT/absent.html", "No such file"),
        ("--verify BAG/metadata.yaml", "is not a validation report"),
        ("--verify BAG/metadata.yaml BAG", "takes no BAG"),
    ],
)
def test_wrong_input_is_one_line(bag, tmp_path, capsys, words, told):
    given = words.replace("BAG", str(bag)).replace("OUT", str(tmp_path)).split()
    assert main(["report", *given]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    assert told in lines[0]


def test_without_the_library_a_pdf_is_refused_before_the_replay(
    bag, tmp_path, capsys, monkeypatch
):
    monkeypatch.setitem(sys.modules, "fpdf", None)
    assert write(bag, tmp_path / "a.pdf") == 2
    assert "requirements/pdf.txt" in capsys.readouterr().err
    assert write(bag, tmp_path / "a.html", "--limit", "60mm") == 0


@pytest.mark.parametrize("count", [0, 2])
def test_a_file_has_one_seal(count):
    with pytest.raises(SloshReportError, match=f"{count} places"):
        sealed(count * seal_line().encode())
