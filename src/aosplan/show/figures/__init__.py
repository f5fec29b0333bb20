"""Figures: what a plan, a stand or a sweep looks like, and the same said in words.

`aosplan.show.figures.draw` lists the kinds, one module each; `aosplan.show.figures.style` has the
colours, and `aosplan.show.figures.canvas` turns a figure into the bytes of a PNG, SVG or PDF file.
"""
