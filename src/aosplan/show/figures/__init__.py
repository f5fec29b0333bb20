"""Figures of a plan, a stand or a sweep.  Each figure has a description as text.

`aosplan.show.figures.draw` has the list of the kinds of figures.  Each kind is a module.
`aosplan.show.figures.style` has the colours, and `aosplan.show.figures.canvas` converts a figure to
the bytes of a PNG, SVG or PDF file.
"""
