"""Tests the documentation: links, commands and parameters are right."""

import re
from pathlib import Path

import pytest
from pages.commands import blocks_of, command_lines, not_said, words_of

from slosh_bringup.cli.main import all_commands, build_parser, main

ROOT = Path(__file__).resolve().parent.parent
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "bags" / "README.md", *sorted(
    page for page in (ROOT / "docs").rglob("*.md") if "_build" not in page.parts
)]  # fmt: skip
CONFIG = ROOT / "src" / "slosh_bringup" / "config"
# What a command writes, by the names of its options.
OUTPUTS = (
    "output", "page", "picture", "print_board", "plot", "strip", "video", "worst", "report",
    "junit",
)  # fmt: skip
# What is named like a file and is none: topics, values of parameters and fields.
TOPICS = (
    "measured", "topic", "topics", "rename", "exclude", "assigned", "remapped", "service",
    "fields",
)  # fmt: skip
# What `make demo` leaves.
DEMO = Path("out/demo")
# What scripts leave where they are started.
SCRIPTS = {
    "tools/stand_in.py": ("pictures", "still.png", "footage"),
    "validation/studies/measured_tank.py": ("out/measured_tank",),
}
# Pages that are typed one after the other; all others stand alone.
TUTORIAL = [ROOT / "docs" / "start" / f"{name}.md" for name in ("cup", "camera", "robot")]
ORDERS = [TUTORIAL, *([page] for page in PAGES if page not in TUTORIAL)]
# Done within a second or two where all that they read is in the repository.
QUICK = ("intrinsics", "motion", "new", "export", "explain")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_relative_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#\s]+)", page.read_text(encoding="utf-8")):
        if "://" not in target:
            assert (page.parent / target).exists(), target


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_named_commands_exist(page):
    for name in re.findall(r"`(?:\.venv/bin/)?slosh ([a-z]+)", page.read_text(encoding="utf-8")):
        assert name in all_commands(), name


# Commands of ROS 2, which wheels do not contain, and what does the same without.
WITHOUT_ROS2 = {
    "run": "slosh node", "launch": "slosh cell", "service": "slosh call", "param": "slosh call",
    "bag": "slosh play",
}  # fmt: skip


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_no_page_needs_ros2(page):
    text = page.read_text(encoding="utf-8")
    for name in re.findall(r"\bros2 ([a-z]+)", text):
        other = WITHOUT_ROS2.get(name, "no such command")
        assert f"`{other}" in text or f"\n{other}" in text, f"ros2 {name} without {other}"


class Reader:
    """Follows the commands on a page; files that one writes exist for the following ones."""

    def __init__(self):
        self.written, self.folder = {DEMO}, Path()

    def take(self, words):
        """Checks a command; raises an error that says what is wrong about it."""
        while "=" in words[0]:
            words = words[1:]
        if words[0] == "cd":
            self.folder = Path(words[1])
        elif words[0] == "make":
            targets = re.findall(r"^(\w[\w-]*):", (ROOT / "Makefile").read_text(), re.M)
            assert words[1] in targets, f"no such target: {words[1]}"
        elif words[0] == "slosh":
            self.take_slosh(words[1:])
        elif words[0].endswith("tools/run") and words[2] != "-c":
            assert words[1] == "python"
            self.take_script(words[2].replace("$SLOSH/", ""), words[3:])

    def take_slosh(self, words):
        """Parses the words of a slosh command as the command itself does."""
        assert words[0] in all_commands(), f"no such command: {words[0]}"
        given = vars(build_parser(words[0]).parse_args(words))
        writes = (*OUTPUTS, "folder") if words[0] == "new" else OUTPUTS
        for name, value in given.items():
            if name not in (*writes, *TOPICS):
                for word in files_in(value):
                    assert self.there(word), f"no such file: {word}"
        self.written |= {Path(word) for name in writes for word in files_in(given.get(name))}

    def take_script(self, script, words):
        """Checks that a script exists and has the given options."""
        path = ROOT / script
        assert path.is_file(), f"no such script: {script}"
        for word in words:
            known = f'"{word}"' in path.read_text(encoding="utf-8")
            assert known or not word.startswith("--"), f"{script}: no such option: {word}"
        self.written |= {Path(name) for name in SCRIPTS.get(script, ())}
        if "-o" in words:
            self.written.add(Path(words[words.index("-o") + 1]))

    def there(self, word):
        """Returns whether a file exists: in the repository, by an earlier command, or CAPITALS."""
        path = Path(word)
        return (
            re.search(r"[A-Z]{3,}|…", word) is not None
            or any(ROOT.glob(word)) or (CONFIG / path.name).exists()
            or any(self.folder / path == one or one in (self.folder / path).parents
                   for one in self.written)
        )  # fmt: skip


def files_in(value):
    """Returns the words among an option's values that name files."""
    values = value if isinstance(value, list | tuple) else [value]
    return [
        str(one) for one in values
        if isinstance(one, Path) or (isinstance(one, str) and re.search(r"/|\.\w{2,5}$", one))
        if not re.match(r"/?slosh$|\w+://", str(one))
    ]  # fmt: skip


@pytest.mark.parametrize("pages", ORDERS, ids=lambda pages: str(pages[-1].relative_to(ROOT)))
def test_commands_can_be_typed_as_they_stand(pages, capsys):
    reader = Reader()
    for page in pages:
        for command in command_lines(page):
            try:
                reader.take(words_of(command.text))
            except (SystemExit, AssertionError) as error:
                told = capsys.readouterr().err.splitlines()[-1:] or error
                pytest.fail(f"{page.name}:{command.line}: {command.text}: {told}")


def test_the_readme_is_short_and_each_command_in_its_lines_can_be_typed():
    page = ROOT / "README.md"
    text = page.read_text(encoding="utf-8")
    assert len(text.split()) <= 800
    reader = Reader()
    for command in command_lines(page):
        reader.take(words_of(command.text))
    inline = re.findall(r"`((?:slosh|make) [a-z][^`]*)`", text)
    assert len([command for command in inline if command.startswith("slosh")]) >= 5
    for command in inline:
        reader.take(words_of(command))


def test_the_readmes_cup_gets_the_answer_that_stands_there(tmp_path, monkeypatch, capsys):
    page = ROOT / "README.md"
    monkeypatch.chdir(tmp_path)
    (block,) = [block for block in blocks_of(page) if block.shown]
    for command in block.commands:
        assert main(words_of(command.text)[1:]) == 0
    assert not not_said(block.shown, capsys.readouterr().out)
    (program,) = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.S)
    exec(compile(program, str(page), "exec"), {})
    assert "Prediction(move.csv: 3.000 s, peak 5.9 mm" in capsys.readouterr().out
    assert main(["predict", "cup/model.yaml", "fast.csv", "--limit", "0.01"]) == 0


def runnable():
    """Returns the quick commands of all pages that read files of the repository, each once."""
    seen = {}
    for page in PAGES:
        for command in () if page in TUTORIAL else command_lines(page):
            words = words_of(command.text)
            if words[0] == "slosh" and words[1] in QUICK:
                given = vars(build_parser(words[1]).parse_args(words[1:]))
                reads = [
                    word for name, value in given.items()
                    if name not in (*OUTPUTS, "folder") for word in files_in(value)
                ]  # fmt: skip
                # What lies in out is of this checkout's past, and no other has it.
                if all((ROOT / word).exists() and Path(word).parts[0] != "out" for word in reads):
                    seen.setdefault(" ".join(words), words)
    return seen


@pytest.mark.parametrize("words", runnable().values(), ids=runnable().keys())
def test_quick_commands_do_what_they_say(words, tmp_path, monkeypatch):
    (tmp_path / "bags").symlink_to(ROOT / "bags")
    monkeypatch.chdir(tmp_path)
    assert main(words[1:]) == 0


@pytest.mark.parametrize(
    "text",
    [
        "slosh dtect IMAGES --camera camera.yaml -o a.csv",
        "slosh detect IMAGES --camera camera.yaml -o a.csv --colour",
        "slosh replay bags/none",
        "slosh replay bags/c3 --model other.yaml",
        "slosh plan model.yaml PATH.csv --limit high -o a.csv",
        "make coffee",
        "tools/run python tools/no_such.py",
        "tools/run python tools/stand_in.py robot --no-such-option",
    ],
)
def test_a_command_that_cannot_be_typed_is_found(text):
    with pytest.raises((SystemExit, AssertionError)):
        Reader().take(words_of(text))


def test_what_a_command_writes_is_there_for_the_next():
    reader = Reader()
    reader.take(words_of("slosh motion quintic --speed 20 --stroke 0.3 -o move.csv"))
    reader.take(words_of("slosh simulate model.yaml move.csv -o heights.csv"))
    drawn = "tools/run python validation/scenes/render.py hd -o out/scenes  # or: all"
    reader.take(words_of(drawn))
    reader.take(words_of("cd out/scenes/hd"))
    reader.take(words_of("slosh detect a.png b.png --camera camera.yaml -o heights.csv"))


def test_every_page_is_listed_by_what_it_is_for():
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    for page in (ROOT / "docs").rglob("*.md"):
        name = page.relative_to(ROOT / "docs").with_suffix("").as_posix()
        # A folder of many of one kind has a first page of its own.
        if not name.startswith(("api/", "effects/", "_build/")) and name != "index":
            assert re.search(rf"^- \[.+\]\({name}\.md\): \S", index, re.M), name
            assert re.search(rf"^{name}$", index, re.M), name
