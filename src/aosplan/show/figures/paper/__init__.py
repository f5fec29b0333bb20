"""The figures with data of Kurmi, Schedl and Bimber (2019), each computed again.

`aosplan.show.figures.paper.registry` lists them, one module each.  Each module has `numbers`, which
computes a `PaperFigure` from a seed, and `draw`.  The paper's scan and recording are not public, so
a stand of trees with the same density is generated (`aosplan.show.figures.paper.stand`) and a
recording above it is rendered (`aosplan.show.figures.paper.recording`).
"""
