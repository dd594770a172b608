"""The tree at the left of pages with source text: the same on all pages of one folder.

No such page is in the table of contents, so nothing is open in its tree. The theme asks for the
tree anew on every page, which took a third of the build.
"""

from typing import Any

from sphinx.application import Sphinx

_SOURCES = "_modules/"


def setup(app: Sphinx) -> dict[str, Any]:
    """Keep the trees of one build; the theme takes them later in the same event."""
    kept: dict[int, str] = {}

    def on_page(
        _app: Sphinx, page: str, _template: str, context: dict[str, Any], _tree: Any
    ) -> None:
        if not page.startswith(_SOURCES):
            return
        made = context["toctree"]

        def tree(**options: Any) -> str:
            # links are relative: what differs is how deep the page lies
            depth = page.count("/")
            if depth not in kept:
                kept[depth] = made(**options)
            return kept[depth]

        context["toctree"] = tree

    app.connect("html-page-context", on_page, priority=400)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
