"""The report: a self-contained HTML page about a plan.

`aosplan.show.page.page` fills the template ``page.html`` with a plan.
"""
