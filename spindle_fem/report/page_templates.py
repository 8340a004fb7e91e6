"""The one template environment: every report extends ``base.html.j2`` and uses its macros."""

from __future__ import annotations

from typing import Any

from spindle_fem import __version__


def render_page(template: str, **context: Any) -> str:
    """Render one of the templates of this package, with everything escaped.

    Raises
    ------
    jinja2.UndefinedError
        The template uses a name that ``context`` does not have.
    """
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("spindle_fem.report", "templates"),
        autoescape=jinja2.select_autoescape(["html", "j2"]),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals["program_version"] = __version__
    return environment.get_template(template).render(**context)
