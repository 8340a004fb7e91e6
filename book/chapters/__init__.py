"""Chapters of the book in their order."""

from book.chapters import (
    balances,
    bench_motor,
    concealed,
    exact,
    machines,
    models,
    network,
    peers,
    published,
    riddle,
    turning_centre,
)
from book.page import Entry

_MODULES = (
    exact,
    balances,
    machines,
    published,
    models,
    network,
    peers,
    concealed,
    riddle,
    bench_motor,
    turning_centre,
)
ENTRIES = tuple(Entry(module.__name__.rpartition(".")[2], module.TITLE, module.make) for module in _MODULES)
