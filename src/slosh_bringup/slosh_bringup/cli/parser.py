"""Argument parser whose errors are one line with a remedy."""

from __future__ import annotations

import argparse
import re
from collections.abc import Mapping, Sequence
from typing import Any, NoReturn

from slosh_base.files.nearest import did_you_mean
from slosh_base.files.plain_text import plain_line

EXIT_WRONG_INPUT = 2
_CHOICE = re.compile(r"(?s)argument (\S+): invalid choice: '(.*)' \(choose from .*\)")
_NOT_A = re.compile(r"(?s)argument (.+?): invalid (\w+) value: '(.*)'")
_MISSING = "the following arguments are required: "
_WORDS = {"int": "a whole number", "float": "a number"}


class SloshParser(argparse.ArgumentParser):
    """An ArgumentParser whose errors are one line with a remedy, with exit code 2."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        # `-5deg` is a value, as `-5` is.
        self._negative_number_matcher = re.compile(r"-\.?\d")

    def parse_known_args(  # type: ignore[override]
        self, args: Sequence[str] | None = None, namespace: argparse.Namespace | None = None
    ) -> tuple[argparse.Namespace, list[str]]:
        """Parses as argparse does, but reports an unknown option before other errors."""
        if args is not None:
            self._refuse_unknown(args)
        found, extras = super().parse_known_args(args, namespace)
        if extras and self._subparsers is None:
            extras = self._late(found, extras)
        if extras and self._subparsers is None:
            self._refuse_extras(extras)
        return found, extras

    def _late(self, found: argparse.Namespace, extras: list[str]) -> list[str]:
        """Assigns a word that follows the options to an optional positional argument."""
        for action in self._get_positional_actions():
            missing = action.nargs == argparse.OPTIONAL and getattr(found, action.dest) is None
            if missing and extras and not extras[0].startswith("-"):
                try:
                    setattr(found, action.dest, self._get_value(action, extras[0]))
                except argparse.ArgumentError as error:
                    self.error(str(error))
                extras = extras[1:]
        return extras

    def error(self, message: str) -> NoReturn:
        """Prints the error in one line and ends the process with exit code 2."""
        self.exit(EXIT_WRONG_INPUT, plain_line(f"{self._name}: {self._worded(message)}") + "\n")

    @property
    def _name(self) -> str:
        """Name of the command, such as `slosh predict`, for error messages."""
        return " ".join(word for word in self.prog.split() if word.replace("-", "").isalnum())

    @property
    def _help(self) -> str:
        words = self._name.split()
        return " ".join([words[0], "help", *words[1:2]])

    def _refuse_unknown(self, args: Sequence[str]) -> None:
        for word in args:
            if word == "--" or (self._subparsers is not None and not word.startswith("-")):
                return
            name = word.partition("=")[0]
            known = self._option_string_actions
            if not name.startswith("--") or " " in word or any(
                option.startswith(name) for option in known
            ):  # fmt: skip
                continue
            meant = did_you_mean(name, known)
            self.error(f"unknown option {name:.60}{meant or f'; {self._help} lists all'}")

    def _refuse_extras(self, extras: list[str]) -> None:
        words = " ".join(extras)
        kind = "unknown option" if extras[0].startswith("-") else "too many arguments:"
        self.error(f"{kind} {words:.120}; {self._help} lists the arguments")

    def _worded(self, message: str) -> str:
        """Rewords an error message of argparse in plain English."""
        if message.startswith(_MISSING):
            return self._missing(message.removeprefix(_MISSING))
        choice, number = _CHOICE.fullmatch(message), _NOT_A.fullmatch(message)
        if choice is not None:
            return self._no_choice(choice[1], choice[2])
        if number is not None:
            return f"{number[1]}: {number[3]!r:.60} is not {_WORDS.get(number[2], number[2])}"
        message = message.removeprefix("argument ")
        return f"{message}; {self._help} shows how" if "expected" in message else message

    def _no_choice(self, option: str, given: str) -> str:
        action = next(
            (one for one in self._actions if option in (*_names(one), one.metavar, one.dest)), None
        )
        known = (
            [] if action is None or action.choices is None else [str(c) for c in action.choices]
        )
        meant = did_you_mean(given, known)
        if self._subparsers is not None:
            return f"unknown command {given!r:.60}{meant or f'; {self._help} lists all'}"
        return f"{option}: {given!r:.60} is not one of {', '.join(known)}{meant}"

    def _missing(self, names: str) -> str:
        """Describes missing arguments, and names multi-value options that may have taken them."""
        greedy = [
            one.option_strings[0] for one in self._actions
            if one.option_strings and one.nargs == "+"
        ]  # fmt: skip
        positional = [one for one in self._actions if not one.option_strings]
        lost = any(str(one.metavar or one.dest) in names.split(", ") for one in positional)
        taken = ""
        if lost and greedy and self._seen(greedy):
            taken = (
                f" (an option of several values, {self._seen(greedy)}, takes all words up to the "
                "next option: put them before it, or -- between)"
            )
        return f"missing: {names}{taken}; {self._help} shows how"

    def _seen(self, options: list[str]) -> str:
        """Returns which of the given options were typed on the command line."""
        return ", ".join(option for option in options if option in self._typed)

    _typed: frozenset[str] = frozenset()

    def _get_values(self, action: argparse.Action, arg_strings: list[str]) -> Any:
        self._typed = self._typed | set(action.option_strings)
        return super()._get_values(action, arg_strings)


def old_name(parser: argparse.ArgumentParser, action: argparse.Action, *names: str) -> None:
    """Accepts an option's former names without showing them in the help."""
    for name in names:
        parser._option_string_actions[name] = action


def grouped_help(usage: str, groups: Mapping[str, Mapping[str, str]], end: str) -> str:
    """Formats the help text of a command whose subcommands are grouped by task.

    Args:
        usage: the first lines.
        groups: title -> subcommand -> summary, in the order in which they are shown.
        end: the last lines.
    """
    width = max(len(name) for group in groups.values() for name in group)
    lines = [usage]
    for title, group in groups.items():
        lines += ["", f"{title}:", *(f"  {name:<{width}}  {text}" for name, text in group.items())]
    return "\n".join([*lines, "", end, ""])


def _names(action: argparse.Action) -> tuple[str, ...]:
    return (*action.option_strings, "/".join(action.option_strings))
