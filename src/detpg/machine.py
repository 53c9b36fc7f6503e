"""What this machine has."""

import os
from pathlib import Path

# Control groups of memory, the newer kind first: the limit, and what is used of it.
GROUPS = (
    ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory.current"),
    (
        "/sys/fs/cgroup/memory/memory.limit_in_bytes",
        "/sys/fs/cgroup/memory/memory.usage_in_bytes",
    ),
)
MEMINFO = "/proc/meminfo"


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def memory() -> int | None:
    """Bytes that this process may still take; where that is unknown, all there are, or None."""
    known = [size for size in (_free(), *map(_left, GROUPS)) if size is not None]
    return max(min(known), 0) if known else None


def _free() -> int | None:
    try:
        rows = dict(row.split(":") for row in Path(MEMINFO).read_text().splitlines())
        return 1024 * int(rows["MemAvailable"].split()[0])
    except (OSError, KeyError, ValueError):
        pass
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, OSError, ValueError):
        return None


def _left(group: tuple[str, str]) -> int | None:
    try:
        limit, used = (int(Path(file).read_text()) for file in group)
    except (OSError, ValueError):  # no such group, or "max"
        return None
    return limit - used
