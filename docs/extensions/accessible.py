"""What the theme leaves out for keyboards and screen readers."""


def _mend(app, pagename, templatename, context, doctree):
    """Blocks that scroll are reached by keyboard; captions in the sidebar have a level."""
    body, tree = context.get("body"), context.get("furo_navigation_tree")
    if body:
        context["body"] = body.replace("<pre>", '<pre tabindex="0">')
    if tree:
        context["furo_navigation_tree"] = tree.replace(
            'role="heading"', 'role="heading" aria-level="2"'
        )


def setup(app):
    app.connect("html-page-context", _mend, priority=900)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
