"""The reference page of machine definitions is complete and up to date."""

from __future__ import annotations

from pathlib import Path

import pytest

import spindle_fem
from scripts.definition_page import meanings, options, reference_page
from spindle_fem.definition.machine_spec import MachineSpec
from spindle_fem.definition.network_tables import NetworkMachineSpec
from spindle_fem.definition.schema import annotation_of, fields_of, shape_of

PAGE = Path(spindle_fem.__file__).parents[1] / "docs" / "machine_definition.md"


def models_below(model):
    yield model
    for field in fields_of((model,)).values():
        shape = shape_of(annotation_of(field))
        while shape.kind in ("list", "mapping"):
            shape = shape_of(shape.inner)
        for inner in shape.models:
            yield from models_below(inner)


MODELS = list(dict.fromkeys([*models_below(MachineSpec), *models_below(NetworkMachineSpec)]))


@pytest.fixture(scope="module")
def page():
    """The page as the models write it now."""
    return reference_page()


@pytest.mark.skipif(not PAGE.parent.is_dir(), reason="the page lies in the source tree, not in the wheel")
def test_the_page_is_up_to_date(page):
    assert PAGE.read_text(encoding="utf-8") == page, (
        "run: python -m scripts.definition_page > docs/machine_definition.md"
    )


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.__name__)
def test_every_key_is_explained_and_listed(model, page):
    texts = meanings(model)
    for key in fields_of((model,)):
        assert texts[key], f"{model.__name__}.{key} has no docstring under it"
        assert key == "marks" or getattr(model, "made", False) or f"| `{key}` |" in page


def test_limits_units_and_defaults_stand_in_the_page(page):
    for line in (
        '| `depth` | Radial height of the section. | a quantity such as "19 mm", above 0 m, or one with a '
        "tolerance | **required** |",
        "| `hand` | Right-handed advances to the rear as the angle grows. | right, left | `right` |",
        "| `starts` | Channels side by side, evenly around the axis. | a whole number from 1 to 4 | `1` |",
        "### `[[bearing_set.bearing]]`",
        "### `[[film]]` with kind rotating",
        "### `[materials.NAME]`",
        "### `[[network.link]]`",
        "| `exponent` | Power of the input. | a number above 0, at most 6 | `1.0` |",
    ):
        assert line in page


def test_everything_that_an_option_names_stands_in_the_page(page):
    found = options()
    assert {"coolant.film_model", "heat.model", "joint.conductance", "bearing_types.NAME.kind"} <= set(found)
    for things in found.values():
        for name in things:
            assert things.summary(name), f"{things.package}.{name} has no docstring"
            assert f"| `{name}` |" in page


def test_the_range_of_a_film_of_turning_walls_is_told(page):
    (line,) = [line for line in page.splitlines() if line.startswith("| `turning` |")]
    assert "reynolds 1000 to 100000" in line
