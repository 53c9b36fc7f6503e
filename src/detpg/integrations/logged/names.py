"""Columns by name: those that are read, those meant to be, those that tell order."""

import collections
import re
from collections.abc import Iterable, Sequence

VECTORS = ("observation", "action", "next_observation")
KNOWN = (*VECTORS, "reward", "terminated", "truncated", "episode")
# What others call what may be absent here: overlooked, episodes would run into one another.
ELSEWHERE = {
    "truncated": ("truncation", "truncations", "timeout", "timeouts", "done", "dones"),
    "next_observation": ("nextobs", "nextobservations", "nextstate", "nextstates"),
}


def _words_of(text: str) -> frozenset[str]:
    return frozenset(text.split())


TIMES = _words_of(
    "t time times timestep timesteps timestamp timestamps ts step steps date dates datetime tick "
    "ticks clock frame frames elapsed"
)
PLACES = _words_of("index idx row rows sample samples sequence seq record unnamed")
GROUPS = _words_of(
    "episode ep trajectory traj rollout trial run plant env environment world machine unit device "
    "robot agent session experiment series batch"
)
UNITS = _words_of(
    "s sec secs second seconds ms msec millis milliseconds us usec micros microseconds µs ns nanos "
    "nanoseconds min mins minute minutes h hour hours d days unix epoch utc gmt local iso"
)
MORE = _words_of("id number no nr num level stamp global sim simulation system wall log event")


def check(file: object, names: Sequence[str]) -> None:
    """Refuses names of which one would be overlooked.

    Raises:
        ValueError: Names the columns, and what to do.
    """
    twice = [name for name, count in collections.Counter(names).items() if count > 1]
    if twice:
        raise ValueError(f"{file} has two columns {twice[0]}: leave one of them out.")
    for vector in VECTORS:
        parts = numbered(names, vector)
        if vector in names and parts:
            raise ValueError(
                f"{file} has the columns {vector} and {parts[0]}: leave one of the two forms out."
            )
    for name in names:
        known = _meant(name, names)
        if known is not None:
            raise ValueError(
                f"{file} has a column {name}, which is not read: name it {known} if that is what "
                "it holds, or leave it out."
            )


def numbered(names: Iterable[str], vector: str) -> list[str]:
    """The columns `vector_0`, `vector_1`, ... that there are."""
    return [name for name in names if re.fullmatch(rf"{vector}_\d+", name)]


def is_time(name: str) -> bool:
    """Whether a column of that name tells when a step was: a clock, a date, a count of steps."""
    words = _words(name)
    known = words <= TIMES | PLACES | GROUPS | UNITS | MORE
    return bool(words & TIMES) and known and not re.search(r"\d", name)  # t_1, t_2: temperatures


def is_only_time(name: str) -> bool:
    """Whether it can mean nothing else, such as a sampling time."""
    words = _words(name) - UNITS
    return len(words) == 1 and words <= TIMES - {"ts"}


def is_date(name: str) -> bool:
    """Whether it may stay for many steps, while another column tells the time of the day."""
    return bool(_words(name) & {"date", "dates"})


def is_place(name: str) -> bool:
    """Whether it tells where a row stood, when nothing tells when."""
    words = _words(name)
    return bool(words & PLACES) and words <= PLACES | MORE


def is_group(name: str) -> bool:
    """Whether it tells what a row belongs to: an episode, a plant."""
    words = _words(name)
    return name not in KNOWN and bool(words & GROUPS) and words <= GROUPS | PLACES | MORE


def _words(name: str) -> frozenset[str]:
    """Lower-case words of `time_s`, `timeStamp`, `Time [s]`; numbers do not count."""
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    return frozenset(re.findall(r"[a-zµ]+", apart.lower()))


def _meant(name: str, names: Sequence[str]) -> str | None:
    """The known column of which this is another spelling."""
    if name in KNOWN or any(numbered([name], vector) for vector in VECTORS):
        return None
    plain = re.sub(r"[^a-z]", "", name.lower())
    for known in KNOWN:
        if plain == known.replace("_", ""):
            return known
    there = [k for k in ELSEWHERE if k in names or numbered(names, k)]
    return next((k for k, more in ELSEWHERE.items() if plain in more and k not in there), None)
