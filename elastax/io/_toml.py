"""Tables of a TOML file, checked key by key against what is expected."""

import dataclasses
import difflib
import math
import pathlib
import tomllib
from collections.abc import Callable
from typing import Any


# value and the place that it stands at -> checked value
Reader = Callable[[Any, str], Any]
_REQUIRED = object()


@dataclasses.dataclass(frozen=True)
class Key:
    """What may stand under a key.

    Attributes:
        read: checks and converts the value; raises `ValueError`.
        default: taken where the key is missing; without it the key must be there.
        meaning: what to add where it is missing.
    """

    read: Reader
    default: Any = _REQUIRED
    meaning: str = "it"


def load_toml(path: str | pathlib.Path) -> dict[str, Any]:
    """Content of a TOML file.

    Raises:
        ValueError: the file cannot be read or is no TOML.
    """
    path = pathlib.Path(path)
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        reason = error.strerror or "unreadable"
        raise ValueError(f"{path}: cannot be read: {reason}") from None
    except UnicodeDecodeError:
        raise ValueError(f"{path}: must be a text file in UTF-8") from None
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"{path}: is no valid TOML: {error}") from None


def table(keys: dict[str, Key]) -> Reader:
    """A table with exactly these keys; missing ones take their default."""

    def read(value, where):
        if not isinstance(value, dict):
            raise ValueError(f"`{where}` must be a table, but is {_shown(value)}")
        for name in value:
            if name not in keys:
                raise ValueError(_unknown(_join(where, name), name, keys))
        result = {}
        for name, key in keys.items():
            place = _join(where, name)
            if name in value:
                result[name] = key.read(value[name], place)
            elif key.default is _REQUIRED:
                raise ValueError(f"`{place}` is missing: add {key.meaning}")
            else:
                result[name] = key.default
        return result

    return read


def array_of(entry: Reader, at_least: int = 0) -> Reader:
    """A list, each of whose entries `entry` reads."""

    def read(value, where):
        if not isinstance(value, list) or len(value) < at_least:
            count = f" of at least {at_least}" if at_least else ""
            raise ValueError(f"`{where}` must be a list{count}, but is {_shown(value)}")
        return [entry(item, f"{where}[{k + 1}]") for k, item in enumerate(value)]

    return read


def named(entry: Reader) -> Reader:
    """A table of any names, each of whose values `entry` reads."""

    def read(value, where):
        if not isinstance(value, dict):
            raise ValueError(f"`{where}` must be a table, but is {_shown(value)}")
        return {name: entry(item, _join(where, name)) for name, item in value.items()}

    return read


def text(value, where) -> str:
    """A text that is not empty."""
    if not isinstance(value, str) or not value.strip():
        raise ValueError(f"`{where}` must be a text, but is {_shown(value)}")
    return value


def flag(value, where) -> bool:
    """true or false."""
    if not isinstance(value, bool):
        raise ValueError(f"`{where}` must be true or false, but is {_shown(value)}")
    return value


def number(value, where) -> float:
    """A finite number."""
    ok = isinstance(value, int | float) and not isinstance(value, bool)
    if not ok or not math.isfinite(value):
        raise ValueError(f"`{where}` must be a finite number, but is {_shown(value)}")
    return float(value)


def integer(value, where) -> int:
    """A whole number."""
    if not isinstance(value, int) or isinstance(value, bool):
        raise ValueError(f"`{where}` must be a whole number, but is {_shown(value)}")
    return value


def positive(value, where) -> float:
    """A number above zero."""
    result = number(value, where)
    if result <= 0:
        raise ValueError(f"`{where}` must be positive, but is {value}")
    return result


def not_negative(value, where) -> float:
    """A number not below zero."""
    result = number(value, where)
    if result < 0:
        raise ValueError(f"`{where}` must not be negative, but is {value}")
    return result


def choice(*options) -> Reader:
    """One of the given texts or numbers."""

    def read(value, where):
        if value not in options:
            listed = ", ".join(map(str, options))
            raise ValueError(
                f"`{where}` must be one of {listed}, but is {_shown(value)}"
            )
        return value

    return read


def vector(length: int) -> Reader:
    """A list of so many numbers."""

    def read(value, where):
        if not isinstance(value, list) or len(value) != length:
            raise ValueError(
                f"`{where}` must be a list of {length} numbers, but is {_shown(value)}"
            )
        return [number(item, f"{where}[{k + 1}]") for k, item in enumerate(value)]

    return read


def _join(where: str, name: str) -> str:
    return f"{where}.{name}" if where else name


def _unknown(place: str, name: str, keys) -> str:
    close = difflib.get_close_matches(name, keys, n=1)
    if close:
        return f"`{place}` is unknown: did you mean `{close[0]}`?"
    return f"`{place}` is unknown: take one of {', '.join(keys)}"


def _shown(value) -> str:
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, list):
        numbers = f"a list of {len(value)}"
        return f"{value}, {numbers}" if len(str(value)) < 50 else numbers
    return repr(value)
