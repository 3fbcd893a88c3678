"""Tests that only the required definitions of installed packages are read."""

import pytest

from slosh_bag.definitions import Definitions
from slosh_bag.errors import SloshBagError


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A message package whose files the test writes."""
    folder = tmp_path / "install" / "share" / "odd_msgs" / "msg"
    folder.mkdir(parents=True)
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "install"))

    def write(**files):
        for name, text in files.items():
            (folder / f"{name}.msg").write_text(text)
        return folder

    return write


def test_a_definition_is_found_for_every_message_of_the_cell():
    definitions = Definitions()
    for name in ("FreeSurface", "SloshEstimate", "SloshComparison", "LimitEvent"):
        assert definitions.text(f"slosh_msgs/msg/{name}")
        assert definitions.hash(f"slosh_msgs/msg/{name}").startswith("RIHS01_")


def test_types_within_types_are_read_too(package):
    package(
        Outer="std_msgs/Header header\nMiddle[] middles\nInner[2] pair\n",
        Middle="Inner inner\n",
        Inner="uint8 value\n",
    )
    text = Definitions().text("odd_msgs/msg/Outer")
    for name in (
        "odd_msgs/Middle",
        "odd_msgs/Inner",
        "std_msgs/Header",
        "builtin_interfaces/Time",
    ):
        assert f"MSG: {name}\n" in text


@pytest.mark.parametrize(
    ("message_type", "match"),
    [
        ("odd_msgs/msg/Absent", r"no definition of odd_msgs/msg/Absent in .*odd_msgs"),
        ("odd_msgs/msg/Outer", r"no definition of odd_msgs/msg/Inner in "),
        ("nowhere_msgs/msg/Thing", r"package nowhere_msgs is not installed here"),
    ],
)
def test_what_has_no_definition_is_named(package, message_type, match):
    package(Outer="Inner inner\n")
    definitions = Definitions()
    for _ in range(2):  # nothing of the first attempt is left behind
        with pytest.raises(SloshBagError, match=match):
            definitions.text(message_type)
