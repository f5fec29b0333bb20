"""The report: a plan as one self-contained HTML page.

`aosplan.show.page.page` fills the template ``page.html`` with a plan.
"""
