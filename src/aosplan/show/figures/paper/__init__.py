"""The figures of Kurmi, Schedl and Bimber (2019) that show data, each computed again.

`aosplan.show.figures.paper.registry` lists the figures.  Each figure has its own module, with two
functions: `numbers` computes a `PaperFigure` from a seed, and `draw` draws it.  The paper's scan
and recording are not public.  Instead of the scan, a stand of trees with the same density is
generated (`aosplan.show.figures.paper.stand`).  Instead of the recording, images from above this
stand are rendered (`aosplan.show.figures.paper.recording`).
"""
