"""Figures of a plan, a stand or a sweep, each with a description in words.

`aosplan.show.figures.draw` lists the kinds of figures, one module each.
`aosplan.show.figures.style` has the colours, and `aosplan.show.figures.canvas` converts a figure to
the bytes of a PNG, SVG or PDF file.
"""
