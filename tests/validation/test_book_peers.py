"""Interpreters that hold other programs."""

import pytest

from book.chapters.peers import interpreter_of
from spindle_fem.errors import BadInputError


def test_an_interpreter_that_cannot_be_run_is_named(monkeypatch):
    monkeypatch.setenv("PEER_PYTHONS", "/nowhere/python /usr/bin/python3")
    with pytest.raises(BadInputError, match=r"PEER_PYTHONS.*/nowhere/python.*cannot be run"):
        interpreter_of("mfem")
