"""The report: a plan as one self-contained page.

`aosplan.show.page.page` fills ``page.html`` from a plan.
"""
